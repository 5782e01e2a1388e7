/// The disk under a live run becomes slow, full, is pulled out and comes back; at last the service is killed.
/// It runs on, says so, and what was recorded can be read.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <imuscope/status_t.hpp>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <sstream>
#include <string_view>

#include "capture/capture_reader.h"
#include "demo_vehicle.h"
#include "programs.h"
#include "rt/host_clock.h"
#include "tests/support/child_process.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;

class CaptureFaults : public testing::Test {
 protected:
  void SetUp() override {
    if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network namespace needs root";
    ASSERT_EQ(std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"), 0);
    bus_.emplace("udpm://239.255.76.67:7667?ttl=0");
    bus_->subscribe("IMUSCOPE_STATUS", &CaptureFaults::on_status, this);
    DemoVehicle().ports_in(folder_ / "ports").write(folder_ / "car.toml");
  }

  void on_status(const lcm::ReceiveBuffer*, const std::string&, const status_t* message) {
    status_ = *message;
  }

  void set_disk(const std::string& mode) const { std::ofstream(folder_ / "disk") << mode; }

  /// The first status for which `condition` holds; fails the test where none comes in time.
  template <typename Condition>
  status_t wait_for(const std::string& what, const Condition& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (std::chrono::steady_clock::now() < end) {
      status_.reset();
      if (bus_->handleTimeout(1000) > 0 && status_ && condition(*status_)) return *status_;
    }
    ADD_FAILURE() << "no status with: " << what << "\n" << read_text(folder_ / "imuscope.log");
    return {};
  }

  static std::int64_t refused_raw(const status_t& status) {
    for (const auto& ring : status.rings) {
      if (ring.name == "raw bytes") return ring.refused;
    }
    return -1;
  }

  static bool tells(const status_t& status, const std::string& text) {
    return std::any_of(status.alarms.begin(), status.alarms.end(), [&](const alarm_t& alarm) {
      return alarm.active != 0 && (alarm.what + alarm.remedy).find(text) != std::string::npos;
    });
  }
  static bool has_disk_alarm(const status_t& status) {
    return std::any_of(status.alarms.begin(), status.alarms.end(),
                       [](const alarm_t& alarm) { return alarm.active != 0 && alarm.kind == "disk"; });
  }

  std::filesystem::path folder_ = scratch_folder();
  std::optional<lcm::LCM> bus_;
  std::optional<status_t> status_;
};

TEST_F(CaptureFaults, ASlowAFullAndAnAbsentDiskAreToldAndSurvivedAndAKillLosesLessThanASecond) {
  set_disk("works");
  BackgroundProgram vehicle("imusim", {"live", (folder_ / "car.toml").string(), "--seconds", "120"},
                            folder_ / "imusim.log");
  setenv("LD_PRELOAD", program_path("libdisk_fault.so").c_str(), 1);
  setenv("DISK_FAULT_CONTROL", (folder_ / "disk").c_str(), 1);
  BackgroundProgram service("imuscope",
                            {"run", (folder_ / "car.toml").string(), "--out", (folder_ / "run").string()},
                            folder_ / "imuscope.log");
  unsetenv("LD_PRELOAD");
  const auto streaming = wait_for("all devices streaming", [](const status_t& s) {
    return std::all_of(s.devices.begin(), s.devices.end(),
                       [](const auto& d) { return d.state == "streaming"; });
  });

  set_disk("slow");
  const auto slow = wait_for("two more seconds on a slow disk",
                             [&](const status_t& s) { return s.tick > streaming.tick + 200; });
  EXPECT_EQ(refused_raw(slow), 0) << "the ring must hold what a slow disk does not take yet";
  EXPECT_EQ(slow.capture_lost, 0);

  set_disk("full");
  const auto full =
      wait_for("a full disk told", [](const status_t& s) { return tells(s, "No space left on device"); });
  EXPECT_EQ(full.state, "degraded");
  EXPECT_TRUE(tells(full, "free space on that disk"));
  EXPECT_NE(read_text(folder_ / "imuscope.log").find("(No space left on device); free space on that disk"),
            std::string::npos)
      << "whoever reads the log alone is told why records are missing, too";

  set_disk("gone");
  const auto gone =
      wait_for("an absent disk told", [](const status_t& s) { return tells(s, "Input/output error"); });
  EXPECT_EQ(gone.state, "degraded");
  EXPECT_GT(gone.capture_lost, full.capture_lost);
  EXPECT_GT(gone.tick, full.tick) << "the service must run on";
  EXPECT_TRUE(std::all_of(gone.devices.begin(), gone.devices.end(),
                          [](const auto& d) { return d.state == "streaming"; }));

  set_disk("works");
  const auto back = wait_for("the disk back", [](const status_t& s) { return !has_disk_alarm(s); });
  const auto more = wait_for("two more seconds of recording", [&](const status_t& s) {
    return s.tick > back.tick + 200 && s.capture_bytes > back.capture_bytes;
  });
  EXPECT_EQ(more.capture_lost, back.capture_lost) << "nothing is lost any more";

  service.send(SIGKILL);
  const HostTime killed = host_now();
  service.wait();
  vehicle.interrupt();
  vehicle.wait();
  const auto summary = summarise_capture(folder_ / "run" / "capture.lcm");
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  EXPECT_EQ(health_of(summary->files).bytes_skipped, 0U) << "a lost record must not damage its neighbours";
  EXPECT_FALSE(summary->losses.empty()) << "the capture must show what is missing";
  HostTime newest = HostTime::min();
  for (const auto& [name, device] : summary->devices) newest = std::max(newest, device.last);
  EXPECT_LT(killed - newest, Duration(std::chrono::seconds(1)));
  EXPECT_EQ(run_program(
                "imuscope",
                {"replay", (folder_ / "run" / "capture.lcm").string(), "--out", (folder_ / "again").string()},
                folder_ / "replay.log"),
            0)
      << read_text(folder_ / "replay.log");
  EXPECT_THAT(read_text(folder_ / "replay.log"), HasSubstr("the replay is not exact from the first on"));
}

/// Whether every line has as many fields as the first.
bool is_whole_table(const std::string& csv) {
  const auto fields = [](std::string_view line) { return std::count(line.begin(), line.end(), ','); };
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  const auto expected = fields(line);
  while (std::getline(lines, line)) {
    if (fields(line) != expected) return false;
  }
  return csv.ends_with('\n');
}

TEST_F(CaptureFaults, AFullDiskThatHasRoomAgainCostsLinesThatAreToldAndTheRunEndsWithItsFiles) {
  const auto disk = folder_ / "disk";
  std::filesystem::create_directory(disk);
  if (!mount_disk(disk, "24m")) GTEST_SKIP() << "mounting needs root";
  // With mountings roughly known every file has rows from the first seconds on.
  DemoVehicle().ports_in(folder_ / "ports").with_priors().write(folder_ / "car.toml");
  BackgroundProgram vehicle("imusim",
                            {"live", (folder_ / "car.toml").string(), "--skip-static", "--seconds", "120"},
                            folder_ / "imusim.log");
  BackgroundProgram service("imuscope",
                            {"run", (folder_ / "car.toml").string(), "--out", (disk / "run").string()},
                            folder_ / "imuscope.log");
  const auto rows = [&] { return std::filesystem::file_size(disk / "run" / "errors_mtx1.csv"); };
  constexpr std::uintmax_t kSomeRows = 50'000;
  (void)wait_for("rows of errors",
                 [&](const status_t& s) { return s.state == "running" && rows() > kSomeRows; });

  std::ofstream(disk / "other").write(std::string(24 << 20, 'x').data(), 24 << 20);
  const auto full =
      wait_for("lines told as lost", [](const status_t& s) { return tells(s, "lines are lost"); });
  EXPECT_EQ(full.state, "degraded");
  EXPECT_TRUE(tells(full, "records were lost"));
  std::filesystem::remove(disk / "other");
  (void)wait_for("the disk back", [](const status_t& s) { return !has_disk_alarm(s); });
  const auto before = rows();
  (void)wait_for("more rows", [&](const status_t&) { return rows() > before + kSomeRows; });

  service.interrupt();
  EXPECT_EQ(service.wait(), 1) << "a run whose files are not whole says so";
  vehicle.interrupt();
  vehicle.wait();
  const auto run = read_json(disk / "run" / "run.json");
  EXPECT_THAT(run.at("warnings").dump(), HasSubstr("lines were lost"));
  EXPECT_TRUE(std::filesystem::exists(disk / "run" / "calibration.json"));
  for (const char* name : {"navigation.csv", "errors_mtx1.csv", "calibration_mtx1.csv"})
    EXPECT_TRUE(is_whole_table(read_text(disk / "run" / name))) << name;
}

}  // namespace
}  // namespace imuscope::test
