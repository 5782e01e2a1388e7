// What is said to the receiver, and what is told about it.
#include "drivers/greis/session.h"

#include <gtest/gtest.h>

#include "tests/drivers/greis/message_builder.h"

namespace imuscope::greis {
namespace {

using namespace test;
using namespace std::chrono_literals;

std::string said(Session& session, HostTime now) {
  const auto bytes = session.poll(now);
  return {bytes.begin(), bytes.end()};
}

Bytes reply(std::string_view id, const std::string& body) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  Bytes bytes = bytes_of(id);
  for (const unsigned shift : {8U, 4U, 0U}) {
    bytes.push_back(static_cast<std::uint8_t>(kHex[body.size() >> shift & 0xFU]));
  }
  const Bytes text = bytes_of(body);
  bytes.insert(bytes.end(), text.begin(), text.end());
  return bytes;
}

Bytes epoch(U32 tod_ms) { return lines({rt(tod_ms), pg(0.85, 0.04, 106.5, 0.5F, 4), et(tod_ms)}); }

TEST(GreisSession, AsksForTheMessagesAtTheConfiguredPeriodOneCommandAfterTheOther) {
  Session session({.period = 200ms, .send_commands = true});
  EXPECT_EQ(said(session, HostTime{0ms}), "%0%dm\r\n");
  EXPECT_EQ(session.state(), SessionState::kConfiguring);
  EXPECT_EQ(said(session, HostTime{10ms}), "");
  session.on_bytes(reply("RE", "%0%\n"), HostTime{20ms});
  EXPECT_EQ(said(session, HostTime{30ms}), "%1%set,/par/raw/msint,100\r\n");
  session.on_bytes(reply("RE", "%1%\n"), HostTime{40ms});
  EXPECT_EQ(said(session, HostTime{50ms}), "%2%em,,jps/{RT,RD,ST,PG,VG,SG,TO,UO,DP,ET}:0.200\r\n");
  session.on_bytes(reply("RE", "%2%\n"), HostTime{60ms});
  EXPECT_EQ(said(session, HostTime{70ms}), "");
  EXPECT_EQ(session.state(), SessionState::kConfiguring);
  session.on_bytes(epoch(1000), HostTime{200ms});
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_TRUE(session.problem().empty());
}

// A line that is opened in the midst of a message shows its end at most: here the beginning of one whose end
// was lost, after which the receiver, stopped, says nothing but its replies.
TEST(GreisSession, RepliesBehindAMessageCutOffAreHeardWithinATenthOfASecond) {
  Session session({});
  const Bytes whole = pg(0.85, 0.04, 106.5, 0.5F, 4);
  session.on_bytes(Bytes(whole.begin(), whole.begin() + 9), HostTime{0ms});
  bool streams = false;
  HostTime streaming{};
  for (int ms = 10; ms < 4000 && session.state() != SessionState::kStreaming; ms += 10) {
    const HostTime now{std::chrono::milliseconds(ms)};
    const std::string command = said(session, now);
    if (!command.empty()) session.on_bytes(reply("RE", command.substr(0, 3) + "\n"), now);
    if (command.find("em,,jps") != std::string::npos) streams = true;
    if (streams && ms % 100 == 0) session.on_bytes(epoch(static_cast<U32>(ms)), now);
    streaming = now;
  }
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_LE(streaming, HostTime{400ms});
}

TEST(GreisSession, AReceiverThatDoesNotAnswerIsTakenAsItIs) {
  Session session({});
  int commands = 0;
  for (int ms = 0; ms < 4900; ms += 10) {
    commands += said(session, HostTime{std::chrono::milliseconds(ms)}).empty() ? 0 : 1;
    if (ms % 100 == 0) session.on_bytes(epoch(static_cast<U32>(ms)), HostTime{std::chrono::milliseconds(ms)});
  }
  EXPECT_EQ(commands, 9);  // three commands, each tried three times
  EXPECT_EQ(session.state(), SessionState::kStreaming);
}

// A receiver that somebody left sending NMEA goes on with it until it hears the stop.
TEST(GreisSession, AReceiverLeftSendingNmeaIsStoppedAndAskedForItsMessages) {
  Session session({});
  bool sends_text = true;
  bool sends_epochs = false;
  int sentences = 0;
  for (int ms = 0; ms < 4000; ms += 10) {
    const HostTime now{std::chrono::milliseconds(ms)};
    const std::string command = said(session, now);
    if (command.find("dm") != std::string::npos) sends_text = false;
    if (command.find("em,,jps") != std::string::npos) sends_epochs = true;
    if (!command.empty()) session.on_bytes(reply("RE", command.substr(0, 3) + "\n"), now);
    if (ms % 100 != 0) continue;
    if (sends_text) {
      ++sentences;
      session.on_bytes(bytes_of("$GPZDA,123456.10,14,03,2026,00,00*60\r\n"), now);
    }
    if (sends_epochs) session.on_bytes(epoch(static_cast<U32>(ms)), now);
  }
  EXPECT_LE(sentences, 1);
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_TRUE(session.problem().empty());
}

TEST(GreisSession, SaysWhatIsWrongWhenNothingComesAndAsksAgain) {
  Session session({});
  int stops = 0;
  for (int ms = 0; ms < 30'000; ms += 10) {
    stops += said(session, HostTime{std::chrono::milliseconds(ms)}) == "%0%dm\r\n" ? 1 : 0;
  }
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_NE(session.problem().find("cable"), std::string_view::npos);
  EXPECT_GT(stops, 3);
}

TEST(GreisSession, BytesWithoutEpochsPointToTheBaudRate) {
  Session session({.period = 100ms, .send_commands = false});
  session.on_bytes(Bytes(300, 0x9c), HostTime{0s});
  EXPECT_EQ(said(session, HostTime{6s}), "");
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_NE(session.problem().find("baud"), std::string_view::npos);
}

TEST(GreisSession, ARefusedCommandIsQuotedWithTheReceiversWords) {
  Session session({});
  EXPECT_EQ(said(session, HostTime{0ms}), "%0%dm\r\n");
  session.on_bytes(reply("RE", "%0%\n"), HostTime{1ms});
  EXPECT_NE(said(session, HostTime{2ms}), "");
  session.on_bytes(reply("ER", "%1%{4,wrong value}\n"), HostTime{3ms});
  EXPECT_NE(session.problem().find("set,/par/raw/msint,100"), std::string_view::npos) << session.problem();
  EXPECT_NE(session.problem().find("wrong value"), std::string_view::npos) << session.problem();
}

}  // namespace
}  // namespace imuscope::greis
