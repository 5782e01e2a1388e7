/// Whoever is on the bus sends what he likes to the running service and to the terminal view: neither ends,
/// and both still hear what is meant for them. Each in a network of its own, so that no other program hears
/// it.

#include <gtest/gtest.h>

#include <sched.h>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <optional>
#include <random>
#include <thread>

#include <imuscope/event_t.hpp>
#include "example_messages.h"
#include "programs.h"
#include "publish/lcm_publisher.h"
#include "publish/message_codec.h"
#include "systemd.h"
#include "tests/support/lcm_datagrams.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kFailedWork = 1;

/// Devices on the network that never send: the service runs on and waits for them.
constexpr const char* kSilentVehicle = R"([run]
name = "silent"
[[device]]
name = "airins"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "udp", host = "", port = 18113 }
[[device]]
name = "mtx1"
role = "study"
protocol = "xsens_mt"
transport = { kind = "udp", host = "", port = 18114 }
)";

class HostileBus : public testing::Test {
 protected:
  void SetUp() override {
    if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network namespace needs root";
    ASSERT_EQ(std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"), 0);
    stranger_.emplace();
    folder_ = scratch_folder();
    std::ofstream(folder_ / "car.toml") << kSilentVehicle;
  }

  /// Calls `again` now and then until `condition` holds.
  static bool soon(
      const std::function<bool()>& condition, const std::function<void()>& again = [] {}) {
    const auto end = std::chrono::steady_clock::now() + seconds(20);
    while (std::chrono::steady_clock::now() < end) {
      again();
      if (condition()) return true;
      std::this_thread::sleep_for(milliseconds(50));
    }
    return false;
  }
  [[nodiscard]] bool log_has(const char* text) const {
    return read_text(folder_ / "log.txt").find(text) != std::string::npos;
  }

  std::filesystem::path folder_;
  std::optional<BusSender> stranger_;  // of the private network, not of the PC's
};

TEST_F(HostileBus, TheServiceOutlivesTheTwoDatagramsAndHearsTheEventBehindThem) {
  BackgroundProgram service("imuscope",
                            {"run", (folder_ / "car.toml").string(), "--out", (folder_ / "run").string()},
                            folder_ / "log.txt");
  ASSERT_TRUE(soon([&] { return log_has("Ctrl-C ends it"); })) << read_text(folder_ / "log.txt");
  for (const char* channel : {"IMUSCOPE_EVENT", "", "any"})
    ASSERT_TRUE(stranger_->send_two_that_kill(channel));
  LcmPublisher::open()->publish(example_event("roundabout"), "EVENT");
  EXPECT_TRUE(soon([&] { return log_has("event: roundabout (from example)"); }))
      << read_text(folder_ / "log.txt");
  service.interrupt();
  EXPECT_EQ(service.wait(), kFailedWork) << "no device sent anything; " << read_text(folder_ / "log.txt");
}

TEST_F(HostileBus, TheTerminalViewOutlivesTheTwoDatagramsAndShowsTheStatusBehindThem) {
  BackgroundProgram top("imuscope", {"top", "--once", "--wait", "20"}, folder_ / "log.txt");
  auto voice = LcmPublisher::open();
  std::this_thread::sleep_for(milliseconds(500));  // to its start; what comes before is not heard
  for (int i = 0; i < 10; ++i) {
    for (const char* channel : {"IMUSCOPE_STATUS", "", "any"})
      ASSERT_TRUE(stranger_->send_two_that_kill(channel));
  }
  EXPECT_TRUE(
      soon([&] { return log_has("run 'demo'"); }, [&] { voice->publish(example_status(), "STATUS"); }))
      << read_text(folder_ / "log.txt");
  EXPECT_EQ(top.wait(), 0) << read_text(folder_ / "log.txt");
}

TEST_F(HostileBus, AFloodOfEventsFillsNeitherLogNorCaptureAndStopsNoSignOfLife) {
  constexpr seconds kLength{10};
  constexpr seconds kWatchdog{2};
  const Systemd systemd(kWatchdog);
  BackgroundProgram service("imuscope",
                            {"run", (folder_ / "car.toml").string(), "--out", (folder_ / "run").string()},
                            folder_ / "log.txt");
  ASSERT_TRUE(soon([&] { return log_has("Ctrl-C ends it"); })) << read_text(folder_ / "log.txt");
  ASSERT_TRUE(soon([&] { return systemd.signs() > 0; }));

  event_t event{};
  event.text = std::string(400, 'x');
  event.source = "stranger";
  const auto bytes = encode_message(event);
  const std::string datagram =
      lc02("IMUSCOPE_EVENT", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  std::uint64_t sent = 0;
  int signs = 0;
  const auto end = std::chrono::steady_clock::now() + kLength;
  while (std::chrono::steady_clock::now() < end) {
    for (int i = 0; i < 100; ++i) sent += stranger_->send(datagram) ? 1 : 0;
    signs += systemd.signs();
  }
  service.interrupt();
  EXPECT_EQ(service.wait(), kFailedWork) << "no device sent anything";
  RecordProperty("datagrams", std::to_string(sent));
  EXPECT_GT(sent, 10'000U);
  // One is due each second; where two in a row do not come, systemd would have ended the service.
  EXPECT_GE(signs, static_cast<int>(kLength / kWatchdog));
  constexpr std::uintmax_t kBytesAMinute = 1'000'000;
  EXPECT_LT(std::filesystem::file_size(folder_ / "log.txt"), kBytesAMinute * kLength.count() / 60);
  EXPECT_LT(std::filesystem::file_size(folder_ / "run" / "capture.lcm"), kBytesAMinute);
  EXPECT_TRUE(log_has("events were neither logged nor recorded")) << read_text(folder_ / "log.txt");
}

/// Datagrams drawn from a seed: of both kinds, right ones that were damaged, and noise.
class DrawnDatagrams {
 public:
  explicit DrawnDatagrams(unsigned seed) : random_(seed) {}

  std::string next() {
    switch (below(4)) {
      case 0:
        return lc02(channel(), noise(below(2000)));
      case 1:
        return lc03({edge(), edge(), static_cast<std::uint16_t>(edge()), static_cast<std::uint16_t>(edge())},
                    channel() + '\0' + noise(below(2000)));
      case 2:
        return damaged(lc02("IMUSCOPE_STATUS", text_of(encode_message(example_status()))));
      default:
        return noise(below(100));
    }
  }

 private:
  std::size_t below(std::size_t end) {
    return std::uniform_int_distribution<std::size_t>(0, end - 1)(random_);
  }
  static std::string text_of(const std::vector<std::uint8_t>& bytes) { return {bytes.begin(), bytes.end()}; }
  std::string noise(std::size_t n) {
    std::string bytes(n, ' ');
    for (char& byte : bytes) byte = static_cast<char>(below(256));
    return bytes;
  }
  std::string channel() {
    constexpr std::array kNames{"IMUSCOPE_EVENT",
                                "IMUSCOPE_STATUS",
                                "IMUSCOPE_CALIBRATION_MTX1",
                                "IMUSCOPE_ODOMETRY",
                                "IMUSCOPE_NOISE_MODEL_MTX1",
                                "IMUSCOPE_EVEN",
                                "IMUSCOPE_EVENT_OLD",
                                ""};
    return kNames.at(below(kNames.size()));
  }
  /// Numbers at which sums and comparisons turn.
  std::uint32_t edge() {
    constexpr std::array<std::uint32_t, 8> kEdges{0,           1,           2,           0x7fff'ffff,
                                                  0x8000'0000, 0xffff'ff80, 0xffff'ffff, 1000};
    return kEdges.at(below(kEdges.size())) + static_cast<std::uint32_t>(below(3));
  }
  std::string damaged(std::string datagram) {
    for (std::size_t i = below(8); i > 0; --i)
      datagram[below(datagram.size())] = static_cast<char>(below(256));
    if (below(2) == 0) datagram.resize(below(datagram.size()));
    return datagram;
  }

  std::mt19937 random_;
};

TEST_F(HostileBus, DrawnDatagramsOfBothKindsEndNeitherTheServiceNorTheTerminalView) {
  const unsigned seed = std::random_device()();
  RecordProperty("seed", std::to_string(seed));
  SCOPED_TRACE("seed " + std::to_string(seed));
  BackgroundProgram service("imuscope",
                            {"run", (folder_ / "car.toml").string(), "--out", (folder_ / "run").string()},
                            folder_ / "log.txt");
  ASSERT_TRUE(soon([&] { return log_has("Ctrl-C ends it"); })) << read_text(folder_ / "log.txt");
  // Another prefix than the service's, so that no status of its own ends the view before the datagrams have
  // come; and one whose channels are the service's.
  BackgroundProgram blind("imuscope", {"top", "--once", "--prefix", "ELSEWHERE", "--wait", "30"},
                          folder_ / "blind.txt");
  BackgroundProgram seeing("imuscope", {"top", "--event", "before"}, folder_ / "seeing.txt");
  EXPECT_EQ(seeing.wait(), 0);

  DrawnDatagrams datagrams(seed);
  constexpr int kDatagrams = 20'000;
  int views = 0;
  for (int i = 0; i < kDatagrams; ++i) {
    (void)stranger_->send(datagrams.next());  // the system refuses what no datagram can carry
    if (i % 200 == 0) std::this_thread::sleep_for(milliseconds(20));
    if (i % 2000 != 0) continue;
    EXPECT_EQ(run_program("imuscope", {"top", "--json", "--wait", "20"}, folder_ / "view.txt"), 0);
    EXPECT_TRUE(nlohmann::json::accept(read_text(folder_ / "view.txt"))) << read_text(folder_ / "view.txt");
    ++views;
  }
  EXPECT_GT(views, 0);
  auto elsewhere = LcmPublisher::open(kDefaultLcmUrl, "ELSEWHERE");
  EXPECT_TRUE(soon([&] { return read_text(folder_ / "blind.txt").find("run 'demo'") != std::string::npos; },
                   [&] { elsewhere->publish(example_status(), "STATUS"); }));
  EXPECT_EQ(blind.wait(), 0) << read_text(folder_ / "blind.txt");
  // What was refused of the flood gives room for one more after its second.
  EXPECT_TRUE(soon([&] { return log_has("event: behind them"); },
                   [&] {
                     LcmPublisher::open()->publish(example_event("behind them"), "EVENT");
                     std::this_thread::sleep_for(seconds(1));
                   }))
      << read_text(folder_ / "log.txt");
  service.interrupt();
  EXPECT_EQ(service.wait(), kFailedWork) << "no device sent anything; " << read_text(folder_ / "log.txt");
}

TEST_F(HostileBus, TheServiceWritesIntoNoFileThatItsBusNames) {
  std::ofstream(folder_ / "precious.txt") << "precious";
  for (const char* url : {"?mode=w", "", "2?mode=w"}) {
    std::ofstream(folder_ / "file.toml")
        << "[lcm]\nurl = \"file://" << (folder_ / "precious.txt").string() << url << "\"\n"
        << kSilentVehicle;
    EXPECT_EQ(
        run_program("imuscope", {"run", (folder_ / "file.toml").string(), "--out", (folder_ / "no").string()},
                    folder_ / "log.txt"),
        2);
    EXPECT_TRUE(log_has("a bus is udpm://")) << read_text(folder_ / "log.txt");
  }
  EXPECT_EQ(read_text(folder_ / "precious.txt"), "precious");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "precious.txt2"));
}

TEST_F(HostileBus, TheTerminalViewRefusesALog) {
  std::ofstream(folder_ / "bus.lcm") << "content";
  for (const char* url : {"", "?mode=w", "?speed=1"}) {
    EXPECT_EQ(run_program("imuscope", {"top", "--lcm", "file://" + (folder_ / "bus.lcm").string() + url},
                          folder_ / "log.txt"),
              2)
        << url;
  }
  EXPECT_EQ(read_text(folder_ / "bus.lcm"), "content");
}

}  // namespace
}  // namespace imuscope::test
