/// The live service on lines of every kind: StdBin by UDP and by TCP, three MTx behind one Xbus Master, an
/// MTi at a baud rate that the configuration does not know, RTKLIB's solutions by TCP. And the faults that
/// live_fault_test does not play: what each does to its own device, and that no other notices.

#include <gtest/gtest.h>
#include <chrono>
#include <cmath>
#include <fstream>
#include <sstream>

#include "demo_vehicle.h"
#include "programs.h"
#include "status_listener.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

constexpr std::chrono::seconds kRun{38};
/// Before the first fault; by then every line is open and the baud rate found.
constexpr double kSettled_s = 83.0;
/// After those of the first group.
constexpr double kBetween_s = 89.5;

constexpr const char* kFaults = R"(
[[fault]]
kind = "burst"
device = "mtx1"
at_s = 84.0
for_s = 4.0
every_s = 0.3
[[fault]]
kind = "saturation"
device = "mtx3"
at_s = 84.0
for_s = 4.0
accel_range_mps2 = 5.0
[[fault]]
kind = "drop"
device = "mti"
at_s = 84.0
for_s = 4.0
share = 0.002
[[fault]]
kind = "duplicate"
device = "airins"
at_s = 84.0
for_s = 4.0
share = 0.1
[[fault]]
kind = "missing"
device = "ins2"
at_s = 94.0
for_s = 1.6
blocks = ["raw_acceleration"]
[[fault]]
kind = "garbage"
device = "ins2"
at_s = 84.0
for_s = 3.0
share = 0.2
[[fault]]
kind = "rtk_jump"
device = "gnss"
at_s = 85.0
for_s = 3.0
by_n_m = [0.0, 0.0, -20.0]
[[fault]]
kind = "solution"
device = "gnss"
at_s = 90.0
for_s = 2.0
type = "none"
[[fault]]
kind = "clock_skew"
device = "mti"
at_s = 89.0
for_s = 20.0
ppm = 100.0
[[fault]]
kind = "stuck"
device = "airins"
at_s = 92.0
for_s = 1.5
[[fault]]
kind = "stuck"
device = "mtx2"
at_s = 90.0
for_s = 1.5
)";

// What imusim serves on this machine.
constexpr int kAirinsPort = 29200;
constexpr int kGnssPort = 29201;
constexpr int kIns2Port = 29202;
/// Of the one line behind which the three MTx sit.
constexpr int kXbusBaud = 460800;

/// The demo with its lines of other kinds and two more S-IMUs.
/// @param file      beside which `ports` has its serial ports
/// @param mti_baud  that the configuration gives the MTi
void write_configuration(const std::filesystem::path& file, int mti_baud) {
  const auto ports = file.parent_path() / "ports";
  DemoVehicle vehicle;
  vehicle.put_on_line("airins", udp_line(kAirinsPort));
  vehicle.put_on_line("gnss", tcp_line(kGnssPort)).set_device("gnss", "protocol", "rtklib_pos");
  for (const int bus_id : {1, 2, 3}) {
    const std::string name = "mtx" + std::to_string(bus_id);
    vehicle.put_on_line(name, serial_line(ports / "xbus", kXbusBaud)).set_device(name, "bus_id", bus_id);
  }
  vehicle.add_device({{"name", "ins2"}, {"role", "study"}, {"protocol", "ixblue_stdbin"}, {"rate_hz", 100.0}},
                     tcp_line(kIns2Port));
  vehicle.add_device({{"name", "mti"}, {"role", "study"}, {"protocol", "xsens_mt"}, {"rate_hz", 100.0}},
                     serial_line(ports / "mti", mti_baud));
  vehicle.set_truth("mti", "model", "mti").write(file);
}

class LiveLines : public testing::Test {
 protected:
  void SetUp() override {
    if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
    write_configuration(folder_ / "vehicle.toml", 921600);
    write_configuration(folder_ / "live.toml", 115200);
    std::ofstream(folder_ / "faults.toml") << kFaults;
  }

  [[nodiscard]] const device_status_t& at(double t_s, const std::string& name) const {
    return listener_.device_at(t_s, name);
  }
  [[nodiscard]] const device_status_t& at_end(const std::string& name) const { return at(1e9, name); }
  /// Samples lost between two times.
  [[nodiscard]] std::int64_t lost(const std::string& name, double begin_s, double end_s) const {
    return at(end_s, name).samples_lost - at(begin_s, name).samples_lost;
  }
  /// Samples per second of the run between two statuses.
  [[nodiscard]] double rate_hz(const std::string& name, double begin_s, double end_s) const {
    const double seconds =
        1e-6 * static_cast<double>(listener_.status_at(end_s).utime - listener_.status_at(begin_s).utime);
    return static_cast<double>(at(end_s, name).samples - at(begin_s, name).samples) / seconds;
  }

  std::filesystem::path folder_ = scratch_folder();
#ifdef IMUSCOPE_HAS_CORE_GUARD
  const std::filesystem::path guard_report_ = folder_ / "guard.txt";
#else
  const std::filesystem::path guard_report_;
#endif
  Listener listener_;
};

struct Row {
  double time_s;
  double height_m;
};

std::vector<Row> heights_of(const std::filesystem::path& run) {
  std::ifstream in(run / "navigation.csv");
  std::vector<Row> rows;
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line.rfind("time_s,utc_s,gps_week,gps_tow_s,lat_deg,lon_deg,height_m,", 0), 0U) << line;
  while (std::getline(in, line)) {
    Row row{};
    double skipped = 0.0;
    char comma = 0;
    std::istringstream cells(line);
    cells >> row.time_s;
    for (int i = 0; i < 5; ++i) cells >> comma >> skipped;
    cells >> comma >> row.height_m;
    rows.push_back(row);
  }
  return rows;
}

TEST_F(LiveLines, EveryKindOfLineAndFaultInOneRun) {
  ASSERT_NO_FATAL_FAILURE(run_beside(folder_, "vehicle.toml", kRun, listener_, guard_report_));
  const std::string log = read_text(folder_ / "imuscope.log");
  SCOPED_TRACE(log);
  if (!guard_report_.empty()) {
    // TCP and UDP lines under the rule of the core, too: no allocation, no lock, no call but those that it
    // may make.
    const auto report = read_guard_report(guard_report_);
    for (const char* thread : {"imuscope-io", "imuscope-est"}) {
      ASSERT_TRUE(report.contains(thread)) << read_text(guard_report_);
      for (const auto& [what, count] : offences_of(report.at(thread)))
        EXPECT_EQ(count, 0) << thread << ": " << what << "\n" << read_text(guard_report_);
    }
  }
  ASSERT_GT(listener_.heard.size(), 25U);

  for (const char* name : {"airins", "mtx1", "mtx2", "mtx3", "gnss", "ins2", "mti"}) {
    EXPECT_EQ(at(kSettled_s, name).state, "streaming") << name;
    EXPECT_EQ(at_end(name).state, "streaming") << name;
    EXPECT_EQ(at_end(name).problem, "") << name;
    EXPECT_EQ(at_end(name).clock_resets, 0) << name;
    EXPECT_EQ(at_end(name).samples_refused, 0) << name;
    if (name == std::string("mti") || name == std::string("gnss")) continue;
    EXPECT_EQ(lost(name, kSettled_s, 1e9), 0) << name;
  }

  // The MTi's speed was found by trying, and told.
  EXPECT_NE(log.find("mti: no answer at"), std::string::npos);
  EXPECT_NE(log.find("/mti at 921600 baud is open"), std::string::npos);
  // And its stamps are dated back by that speed, not by the configured one: some 60 bytes a message.
  EXPECT_NEAR(at_end("mti").wire_ms, 1e3 * 60.0 * 10.0 / 921600.0, 0.3);
  EXPECT_EQ(at_end("airins").wire_ms, 0.0) << "datagrams come whole";

  // One line carries three devices, and the service says so of each: IMU samples at 100 Hz.
  for (const char* name : {"mtx1", "mtx2", "mtx3"}) {
    EXPECT_NEAR(rate_hz(name, kSettled_s, 1e9), 100.0, 5.0) << name;
    EXPECT_EQ(at_end(name).bad_checksums, 0) << name;
  }

  // Datagrams sent twice are taken once: IMU and attitude of each telegram.
  EXPECT_NEAR(rate_hz("airins", kSettled_s, kBetween_s), 200.0, 12.0);
  EXPECT_GT(at(kBetween_s, "airins").frames - at(kSettled_s, "airins").frames,
            (at(kBetween_s, "airins").samples - at(kSettled_s, "airins").samples) / 2 + 20);
  // Frozen raw blocks: told, not used, and used again when they move.
  EXPECT_TRUE(listener_.any_status("airins", [](const device_status_t& device) {
    return device.problem.find("does not change") != std::string::npos;
  }));

  // Without its raw acceleration a unit gives no IMU samples, only its attitude.
  EXPECT_TRUE(listener_.any_status("ins2", [](const device_status_t& device) {
    return device.problem.find("no raw rotation rate or no raw acceleration") != std::string::npos;
  }));
  // Bytes between telegrams are stepped over.
  EXPECT_GT(at(kBetween_s, "ins2").bytes_skipped, at(kSettled_s, "ins2").bytes_skipped + 100);
  EXPECT_NEAR(rate_hz("ins2", kSettled_s, kBetween_s), 200.0, 12.0);

  // A receiver without a solution for 2 s sends none: 20 epochs are missing, and counted.
  EXPECT_EQ(lost("gnss", kSettled_s, kBetween_s), 0);
  EXPECT_NEAR(static_cast<double>(lost("gnss", kBetween_s, 1e9)), 20.0, 1.0);

  // Lost bytes cost the messages that they were in: 4 s of some 60 bytes a message, 2 in 1000 lost: 11 %.
  EXPECT_GE(lost("mti", kSettled_s, kBetween_s), 15);
  EXPECT_LE(lost("mti", kSettled_s, kBetween_s), 90);
  EXPECT_EQ(lost("mti", kBetween_s, 1e9), 0);

  // Numbers that cannot be true of the S-IMU are kept out of the filter and counted.
  const auto gated = [&](const char* name, double begin_s, double end_s) {
    return listener_.study_at(end_s, name).gated - listener_.study_at(begin_s, name).gated;
  };
  // An update takes a window of samples, which begins anew every fifth of a second or sooner.
  constexpr std::int64_t kUpdatesOfFourSeconds = 20;
  EXPECT_GT(gated("mtx3", kSettled_s, kBetween_s), kUpdatesOfFourSeconds)
      << "5 m/s2 of 9.8: hardly any vertical force fits";

  // 20 m up for 3 s, called fixed: the filter does not follow.
  const auto heights = heights_of(folder_ / "live");
  ASSERT_GT(heights.size(), 250U);
  double step_m = 0.0;
  for (std::size_t i = 1; i < heights.size(); ++i)
    step_m = std::max(step_m, std::abs(heights[i].height_m - heights[i - 1].height_m));
  EXPECT_LT(step_m, 1.0);

  // What happened is in the recording.
  ASSERT_EQ(run_program("imuscope",
                        {"replay", (folder_ / "live" / "capture.lcm").string(), "--out",
                         (folder_ / "replay").string()},
                        folder_ / "replay.log"),
            0)
      << read_text(folder_ / "replay.log");
  for (const char* name : {"navigation.csv", "errors_mtx2.csv", "errors_mti.csv", "errors_ins2.csv"}) {
    const auto live = read_text(folder_ / "live" / name);
    EXPECT_GT(live.size(), 1000U) << name;
    EXPECT_TRUE(live == read_text(folder_ / "replay" / name)) << name << " differs between live and replay";
  }
}

}  // namespace
}  // namespace imuscope::test
