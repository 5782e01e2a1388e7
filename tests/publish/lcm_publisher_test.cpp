#include "publish/lcm_publisher.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <imuscope/error_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <lcm/lcm-cpp.hpp>
#include <map>

#include "example_messages.h"
#include "publish/lcm_listener.h"
#include "publish/message_codec.h"
#include "tests/support/child_process.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::in_private_network;
using test::kNotPermitted;
using testing::AllOf;
using testing::HasSubstr;

/// Publishes into a log and reads it with the library's own reader.
std::map<std::string, int> channels_of(const std::filesystem::path& log_path) {
  std::map<std::string, int> channels;
  lcm::LogFile log(log_path.string(), "r");
  EXPECT_TRUE(log.good());
  while (const lcm::LogEvent* event = log.readNextEvent()) channels[event->channel] += 1;
  return channels;
}

TEST(LcmPublisher, EachMessageGoesToItsChannel) {
  const auto path = test::scratch_folder() / "bus.lcm";
  {
    auto publisher = LcmPublisher::open("file://" + path.string() + "?mode=w", "CAR2");
    ASSERT_TRUE(publisher.has_value()) << publisher.error().text();
    publisher->publish(test::example_status(), "STATUS");
    publisher->publish(test::example_navigation(), "NAVIGATION");
    publisher->publish(test::example_navigation(), "NAVIGATION");
    publisher->publish(test::example_calibration(), "CALIBRATION", "mtx1");
    publisher->publish(test::example_error(), "ERROR", "mtx2");
    publisher->publish(pose_t{}, "POSE");
    EXPECT_EQ(publisher->counters().published, 6U);
    EXPECT_EQ(publisher->counters().failed, 0U);
  }
  const std::map<std::string, int> expected{{"CAR2_STATUS", 1},
                                            {"CAR2_NAVIGATION", 2},
                                            {"CAR2_CALIBRATION_MTX1", 1},
                                            {"CAR2_ERROR_MTX2", 1},
                                            {"CAR2_POSE", 1}};
  EXPECT_EQ(channels_of(path), expected);
}

TEST(LcmPublisher, SequencesCountPerChannel) {
  const auto path = test::scratch_folder() / "bus.lcm";
  {
    auto publisher = LcmPublisher::open("file://" + path.string() + "?mode=w");
    ASSERT_TRUE(publisher.has_value());
    publisher->publish(test::example_error(), "ERROR", "mtx1");
    publisher->publish(test::example_error(), "ERROR", "mtx2");
    publisher->publish(test::example_error(), "ERROR", "mtx1");
  }
  lcm::LogFile log(path.string(), "r");
  std::map<std::string, std::vector<std::int64_t>> sequences;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    error_t message;
    ASSERT_EQ(message.decode(event->data, 0, event->datalen), event->datalen);
    sequences[event->channel].push_back(message.sequence);
  }
  EXPECT_EQ(sequences["IMUSCOPE_ERROR_MTX1"], (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(sequences["IMUSCOPE_ERROR_MTX2"], (std::vector<std::int64_t>{0}));
}

TEST(LcmPublisher, TheTapGetsWhatIsSent) {
  const auto path = test::scratch_folder() / "bus.lcm";
  auto publisher = LcmPublisher::open("file://" + path.string() + "?mode=w");
  ASSERT_TRUE(publisher.has_value());
  std::string channel;
  std::int64_t utime = 0;
  error_t message;
  publisher->set_tap([&](std::string_view on, std::int64_t at, std::span<const std::uint8_t> bytes) {
    channel = on;
    utime = at;
    message.decode(bytes.data(), 0, static_cast<int>(bytes.size()));
  });
  publisher->publish(test::example_error(), "ERROR", "mtx1");
  EXPECT_EQ(channel, "IMUSCOPE_ERROR_MTX1");
  EXPECT_EQ(utime, 1'700'000'000'123'456);
  ASSERT_EQ(message.rows.size(), 1U);
  EXPECT_EQ(message.rows[0].counter, 70'001);
}

TEST(LcmPublisher, WithoutABusTheTapGetsAllAndSequencesGoOnWithOne) {
  auto publisher = LcmPublisher::unconnected("CAR");
  std::vector<std::int64_t> tapped;
  publisher.set_tap([&](std::string_view on, std::int64_t, std::span<const std::uint8_t> bytes) {
    EXPECT_EQ(on, "CAR_ERROR_MTX1");
    tapped.push_back(decode_message<error_t>(bytes).value().sequence);
  });
  publisher.publish(test::example_error(), "ERROR", "mtx1");
  EXPECT_FALSE(publisher.connect("tcpq://localhost:7700"));
  publisher.publish(test::example_error(), "ERROR", "mtx1");
  EXPECT_EQ(publisher.counters().published, 0U);
  const auto path = test::scratch_folder() / "bus.lcm";
  ASSERT_TRUE(publisher.connect("file://" + path.string() + "?mode=w"));
  publisher.publish(test::example_error(), "ERROR", "mtx1");
  EXPECT_EQ(publisher.counters().published, 1U);
  EXPECT_EQ(tapped, (std::vector<std::int64_t>{0, 1, 2}));
}

TEST(LcmPublisher, AMessageThatWouldNotFitADatagramIsCountedAndNotSent) {
  const auto path = test::scratch_folder() / "bus.lcm";
  {
    auto publisher = LcmPublisher::open("file://" + path.string() + "?mode=w");
    ASSERT_TRUE(publisher.has_value());
    noise_model_t large = test::example_noise_model();
    large.models[0].warnings = {std::string(kMaxMessageBytes, 'x')};
    large.models[0].n_warnings = 1;
    publisher->publish(large, "NOISE_MODEL", "mtx1");
    publisher->publish(test::example_noise_model(), "NOISE_MODEL", "mtx1");
    EXPECT_EQ(publisher->counters().too_large, 1U);
    EXPECT_EQ(publisher->counters().published, 1U);
  }
  lcm::LogFile log(path.string(), "r");
  const lcm::LogEvent* event = log.readNextEvent();
  ASSERT_NE(event, nullptr);
  noise_model_t message;
  ASSERT_EQ(message.decode(event->data, 0, event->datalen), event->datalen);
  EXPECT_EQ(message.sequence, 1) << "the receiver must see the gap that the unsent message leaves";
}

TEST(LcmPublisher, RefusesUrlsThatCannotServeWithTheReasonAndTheRightForm) {
  const struct {
    const char* url;
    const char* reason;
  } cases[] = {{"tcpq://localhost:7700", "aborts the whole process"},
               {"http://localhost", "imuscope speaks udpm:// (network) and file:// (log)"},
               {"", "imuscope speaks udpm://"},
               {"udpm://192.168.1.7:7667?ttl=0", "'192.168.1.7' is not a multicast address"},
               {"udpm://239.255.76:7667", "'239.255.76' is not a multicast address"},
               {"udpm://239.255.76.67:port", "'port' is not a port"},
               {"udpm://239.255.76.67:99999", "'99999' is not a port"},
               {"udpm://239.255.76.67:7667?ttl=", "ttl '' is not a number"},
               {"udpm://239.255.76.67:7667?ttl=256", "ttl '256' is not a number from 0 to 255"},
               {"udpm://239.255.76.67:7667?ttl=-1", "ttl '-1' is not a number"},
               {"udpm://239.255.76.67:7667?ttl=0&ttl=1", "ttl '0&ttl=1' is not a number"},
               {"udpm://239.255.76.67:7667?TTL=1", "'TTL=1' is no option of it"}};
  for (const auto& [url, reason] : cases) {
    const auto publisher = LcmPublisher::open(url);
    ASSERT_FALSE(publisher.has_value()) << url;
    EXPECT_EQ(publisher.error().kind, ErrorKind::kUsage) << url;
    EXPECT_THAT(publisher.error().text(),
                AllOf(HasSubstr(reason), HasSubstr("udpm://239.255.76.67:7667?ttl=0")));
  }
}

struct Received {
  int count = 0;
  error_t last;
  void on_error(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/,
                const error_t* message) {
    count += 1;
    last = *message;
  }
};

int publish_over_multicast() {
  if (std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo") != 0) return 1;
  auto publisher = LcmPublisher::open();
  if (!publisher) return 2;
  lcm::LCM receiver{std::string(kDefaultLcmUrl)};
  if (!receiver.good()) return 3;
  Received received;
  receiver.subscribe("IMUSCOPE_ERROR_MTX1", &Received::on_error, &received);
  for (int i = 0; i < 10; ++i) publisher->publish(test::example_error(), "ERROR", "mtx1");
  constexpr int kTimeoutMs = 2000;
  while (received.count < 10 && receiver.handleTimeout(kTimeoutMs) > 0) {
  }
  if (received.count != 10) return 4;
  return received.last.sequence == 9 && received.last.rows.at(0).counter == 70'001 &&
                 received.last.regime == "dynamic"
             ? 0
             : 5;
}

int hear_an_event() {
  if (std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo") != 0) return 1;
  auto ear = LcmListener::open();
  auto voice = LcmPublisher::open();
  if (!ear || !voice) return 2;
  std::vector<std::string> texts;
  const auto subscribed =
      ear->subscribe("EVENT", [&](const std::string& channel, std::span<const std::uint8_t> bytes) {
        if (channel != "IMUSCOPE_EVENT") return;
        if (const auto event = decode_message<event_t>(bytes)) texts.push_back(event->text);
      });
  if (!subscribed) return 5;
  voice->publish(test::example_event("first"), "EVENT");
  voice->publish(test::example_status(), "STATUS");  // another channel: not for this ear
  voice->publish(test::example_event("second"), "EVENT");
  for (int i = 0; i < 20 && texts.size() < 2; ++i) (void)ear->wait(std::chrono::milliseconds(100));
  if (texts != std::vector<std::string>{"first", "second"}) return 3;
  return ear->wait(std::chrono::milliseconds(0)) == 0 ? 0 : 4;
}

TEST(LcmListener, HearsItsChannelsInOrderAndNothingElse) {
  const int outcome = in_private_network(hear_an_event);
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: ip failed, 2: not open, 3: messages, 4: something is left, "
                           "5: not subscribed";
}

TEST(LcmListener, RefusesTheUrlThatWouldAbortTheProcess) {
  const auto ear = LcmListener::open("tcpq://localhost:7700");
  ASSERT_FALSE(ear.has_value());
  EXPECT_EQ(ear.error().kind, ErrorKind::kUsage);
}

TEST(LcmListener, HearsABusAndNoFile) {
  const auto ear = LcmListener::open("file://" + (test::scratch_folder() / "bus.lcm").string());
  ASSERT_FALSE(ear.has_value());
  EXPECT_EQ(ear.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(ear.error().text(), HasSubstr("a bus is udpm://"));
}

TEST(LcmPublisher, WritesOverNoFile) {
  const auto path = test::scratch_folder() / "kept.txt";
  std::ofstream(path) << "kept";
  std::filesystem::create_symlink("nowhere", path.string() + ".link");
  for (const char* url : {"?mode=w", ".link?mode=w"}) {
    const auto publisher = LcmPublisher::open("file://" + path.string() + url);
    ASSERT_FALSE(publisher.has_value()) << url;
    EXPECT_EQ(publisher.error().kind, ErrorKind::kUsage);
    EXPECT_THAT(publisher.error().text(), HasSubstr("exists and would be written over"));
  }
  EXPECT_EQ(std::filesystem::file_size(path), 4U);
}

TEST(LcmPublisher, PublishesIntoNoLogThatIsToBeRead) {
  // The library writes through a null pointer there.
  for (const char* end : {"", "?mode=r", "?speed=1", "?mode=r&mode=w", "?speed=1?mode=w"}) {
    const auto publisher = LcmPublisher::open("file:///nowhere/bus.lcm" + std::string(end));
    ASSERT_FALSE(publisher.has_value()) << end;
    EXPECT_THAT(publisher.error().text(), HasSubstr("write it as file://PATH?mode=w")) << end;
  }
}

TEST(LcmPublisher, ReachesAReceiverByMulticast) {
  const int outcome = in_private_network(publish_over_multicast);
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: ip failed, 2: publisher, 3: receiver, 4: messages lost, 5: contents";
}

int open_without_route(const std::filesystem::path& stderr_path) {
  const int file = ::open(stderr_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file < 0 || dup2(file, STDERR_FILENO) < 0) return 1;
  const auto publisher = LcmPublisher::open();
  if (publisher.has_value()) return 2;
  const std::string text = publisher.error().text();
  if (publisher.error().kind != ErrorKind::kWork) return 3;
  if (text.find("no route to the multicast address 239.255.76.67") == std::string::npos) return 4;
  if (text.find("'ip link set lo up multicast on'") == std::string::npos) return 5;
  if (text.find("'ip route add 224.0.0.0/4 dev lo'") == std::string::npos) return 6;
  // The remedy, word for word, must be one.
  if (std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo") != 0) return 7;
  return LcmPublisher::open().has_value() ? 0 : 8;
}

TEST(LcmPublisher, WithoutARouteNamesTheTwoCommandsThatMendItAndTheyDo) {
  const auto stderr_path = test::scratch_folder() / "stderr.txt";
  const int outcome = in_private_network([&] { return open_without_route(stderr_path); });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "see the numbers in open_without_route";
  EXPECT_EQ(std::filesystem::file_size(stderr_path), 0U) << "the library wrote to the terminal";
}

}  // namespace
}  // namespace imuscope
