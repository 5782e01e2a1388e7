#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "firmware_sim/io/pc_clock.h"
#include "firmware_sim/io/serial_line.h"
#include "firmware_sim/io/tcp_server.h"

namespace imusim {
namespace {

struct Read {
  Bytes bytes;
  double at_s;
};

/// Twenty messages of 31 bytes, one each 10 ms, through a line without scheduling jitter.
std::vector<Read> through(ReadModel model, int baud, double deliver_step_s = 1.0) {
  LineOptions options;
  options.reads = model;
  options.baud = baud;
  options.jitter_mean_s = 0.0;
  SerialLine line(options, Random(1, "line"));
  std::vector<Read> reads;
  const auto on_read = [&](std::span<const std::uint8_t> bytes, std::int64_t arrival_ns) {
    reads.push_back({Bytes(bytes.begin(), bytes.end()), static_cast<double>(arrival_ns) * 1e-9});
  };
  std::uint8_t next = 0;
  double delivered_s = 0.0;
  for (int message = 0; message < 20; ++message) {
    const double ready_s = 0.0103 + 0.01 * message;
    for (; delivered_s + deliver_step_s < ready_s; delivered_s += deliver_step_s)
      line.deliver_until(delivered_s + deliver_step_s, on_read);
    Emission emission{ready_s, Bytes(31)};
    for (std::uint8_t& byte : emission.bytes) byte = next++;
    line.send(emission);
  }
  line.deliver_until(std::numeric_limits<double>::infinity(), on_read);
  return reads;
}

/// Every byte comes once, in order, and not before its stop bit.
void expect_causal_and_complete(const std::vector<Read>& reads, int baud) {
  std::size_t count = 0;
  for (const Read& read : reads) {
    for (const std::uint8_t byte : read.bytes) {
      EXPECT_EQ(byte, static_cast<std::uint8_t>(count));
      const std::size_t message = count / 31;
      const double done_s =
          0.0103 + 0.01 * static_cast<double>(message) + 10.0 / baud * static_cast<double>(count % 31 + 1);
      EXPECT_GE(read.at_s, done_s - 2e-9);
      ++count;
    }
  }
  EXPECT_EQ(count, 620U);
}

TEST(SerialLine, AMessageArrivesWhenItsLastByteHasLeftTheWire) {
  const std::vector<Read> reads = through(ReadModel::kMessages, 115200);
  expect_causal_and_complete(reads, 115200);
  ASSERT_EQ(reads.size(), 20U);
  for (std::size_t i = 0; i < reads.size(); ++i)
    EXPECT_NEAR(reads[i].at_s, 0.0103 + 0.01 * static_cast<double>(i) + 310.0 / 115200.0, 2e-9);
}

TEST(SerialLine, UsbReadsLieOnFramesAndWaitAtMostOne) {
  const std::vector<Read> reads = through(ReadModel::kUsbFrames, 115200);
  expect_causal_and_complete(reads, 115200);
  for (const Read& read : reads) {
    const double frames = read.at_s / 1e-3;
    EXPECT_NEAR(frames, std::round(frames), 1e-5);
    EXPECT_LE(read.bytes.size(), 12U);  // 11.52 bytes in 1 ms
  }
}

TEST(SerialLine, AnFtdiAdapterSendsFullPacketsOrAfterItsTimer) {
  const std::vector<Read> reads = through(ReadModel::kFtdi, 115200);
  expect_causal_and_complete(reads, 115200);
  std::size_t count = 0;
  for (const Read& read : reads) {
    EXPECT_LE(read.bytes.size(), 62U);
    const std::size_t message = count / 31;
    const double first_done_s =
        0.0103 + 0.01 * static_cast<double>(message) + 10.0 / 115200 * static_cast<double>(count % 31 + 1);
    EXPECT_LE(read.at_s - first_done_s, 0.017 + 1e-8);  // timer and one USB frame
    count += read.bytes.size();
  }
  EXPECT_LE(reads.size(), 14U);  // 0.2 s in 16 ms steps
}

TEST(SerialLine, DeliveringInSmallStepsChangesNothing) {
  for (const ReadModel model : {ReadModel::kMessages, ReadModel::kUsbFrames, ReadModel::kFtdi}) {
    const std::vector<Read> coarse = through(model, 57600);
    const std::vector<Read> fine = through(model, 57600, 0.0007);
    ASSERT_EQ(coarse.size(), fine.size());
    for (std::size_t i = 0; i < coarse.size(); ++i) {
      EXPECT_EQ(coarse[i].bytes, fine[i].bytes);
      EXPECT_EQ(coarse[i].at_s, fine[i].at_s);
    }
  }
}

TEST(SerialLine, ASlowLineFallsBehindAndKeepsTheOrder) {
  const std::vector<Read> reads = through(ReadModel::kMessages, 9600);
  ASSERT_EQ(reads.size(), 20U);
  // 310 bits at 9600 bit/s take 32 ms: the last message ends 20 of them after the first began.
  EXPECT_NEAR(reads.back().at_s, 0.0103 + 20.0 * 310.0 / 9600.0, 2e-9);
}

TEST(SerialLine, TheHostsClockHasItsOwnOriginAndRate) {
  LineOptions options;
  options.reads = ReadModel::kMessages;
  options.jitter_mean_s = 0.0;
  options.host_begin_ns = 5'000'000'000;
  options.clock.rate_ppm = 100.0;
  SerialLine line(options, Random(1, "line"));
  line.send({100.0, Bytes{1}});
  std::int64_t arrival = 0;
  line.deliver_until(200.0,
                     [&](std::span<const std::uint8_t>, std::int64_t arrival_ns) { arrival = arrival_ns; });
  EXPECT_NEAR(static_cast<double>(arrival), 5e9 + (100.0 + 10.0 / 115200) * 1e9 * (1.0 + 100e-6), 2.0);
}

TEST(PcClock, CountsTheIntegralOfItsRate) {
  const PcClock clock = PcClock::drawn(Random(7, "pc clock"), 900.0);
  EXPECT_LE(std::abs(clock.rate_ppm), 50.0);
  EXPECT_GT(clock.slews.size(), 13U);
  double counted_s = clock.seconds_at(0.0);
  EXPECT_EQ(counted_s, 0.0);
  constexpr double kStep_s = 1e-3;
  double fastest_ppm = 0.0;
  for (int k = 0; k < 900'000; ++k) {
    const double t_s = (k + 0.5) * kStep_s;
    counted_s += kStep_s * (1.0 + 1e-6 * clock.ppm_at(t_s));
    fastest_ppm = std::max(fastest_ppm, std::abs(clock.ppm_at(t_s)));
  }
  // A step may hold the end of a slew: 500 ppm of 1 ms, thirty times.
  EXPECT_NEAR(clock.seconds_at(900.0), counted_s, 30 * 500e-6 * kStep_s);
  EXPECT_GT(fastest_ppm, 440.0);  // the 5 ms
}

TEST(PcClock, StandsWhileThePcSleepsAndRunsWarm) {
  PcClock clock;
  clock.suspends.push_back({100.0, 130.0});
  EXPECT_EQ(clock.seconds_at(99.0), 99.0);
  EXPECT_EQ(clock.seconds_at(115.0), 100.0);
  EXPECT_EQ(clock.seconds_at(200.0), 170.0);
  PcClock warm;
  warm.warm_up_ppm = 2.0;
  warm.warm_up_s = 600.0;
  EXPECT_NEAR(warm.ppm_at(600.0), 2.0 * (1.0 - std::exp(-1.0)), 1e-12);
  EXPECT_NEAR(warm.seconds_at(600.0) - 600.0, 2e-6 * 600.0 * std::exp(-1.0), 1e-12);
}

/// A program that connects to a server of this PC.
class Client {
 public:
  explicit Client(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in there{};
    there.sin_family = AF_INET;
    there.sin_port = htons(port);
    there.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<const sockaddr*>(&there), sizeof there), 0);
  }
  ~Client() { ::close(fd_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  void say(const std::string& text) const {
    EXPECT_EQ(::send(fd_, text.data(), text.size(), 0), std::ssize(text));
  }
  [[nodiscard]] std::string hear(std::size_t count) const {
    std::string text(count, ' ');
    text.resize(static_cast<std::size_t>(std::max<ssize_t>(0, ::recv(fd_, text.data(), count, MSG_WAITALL))));
    return text;
  }

 private:
  int fd_;
};

TEST(TcpServer, GreetsEachClientAndCarriesBytesBothWays) {
  auto server = TcpServer::open("127.0.0.1", 0, Bytes{'%', '\n'});
  ASSERT_TRUE(server) << server.error();
  EXPECT_EQ(server->write(Bytes{1, 2, 3}), 3U);  // nobody is there
  {
    const Client client(server->port());
    EXPECT_EQ(server->write(Bytes{'a', 'b'}), 0U);
    EXPECT_EQ(client.hear(4), "%\nab");
    client.say("xyz");
    Bytes heard;
    while (heard.size() < 3) put_bytes(heard, server->read());
    EXPECT_EQ(heard, (Bytes{'x', 'y', 'z'}));
  }
  while (server->write(Bytes{'c'}) == 0) {  // until it notices that the client left
  }
  const Client again(server->port());
  while (server->write(Bytes{'d'}) != 0) {
  }
  EXPECT_EQ(again.hear(3), "%\nd");
}

TEST(TcpServer, SaysWhyItCannotListen) {
  const auto server = TcpServer::open("127.0.0.1", 0, {});
  ASSERT_TRUE(server);
  const auto second = TcpServer::open("127.0.0.1", server->port(), {});
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().find("cannot listen on 127.0.0.1:"), std::string::npos);
  EXPECT_NE(TcpServer::open("nowhere", 1, {}).error().find("'nowhere'"), std::string::npos);
}

}  // namespace
}  // namespace imusim
