/// What tells time, live: datagrams and connections stamped by the kernel, and a PPS device (played at its
/// ioctls, as this kernel may have none) that tells the PC's clock to microseconds while somebody sets the
/// wall clock. The capture replays to the same rows.

#include <gtest/gtest.h>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>

#include "programs.h"
#include "status_listener.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::seconds;

std::string vehicle(const std::filesystem::path& pulses) {
  return R"([run]
name = "time"
[[device]]
name = "airins"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "udp", port = 29600 }
[[device]]
name = "ins"
role = "study"
protocol = "ixblue_stdbin"
transport = { kind = "tcp", host = "127.0.0.1", port = 29601 }
prior = { rotation_vector_b_s_deg = [0.0, 0.0, 0.0], boresight_sd_deg = 3.0, lever_arm_sd_m = 0.5, time_offset_ms = 0.0, time_offset_sd_ms = 10.0 }
[[device]]
name = "gnss"
role = "gnss"
protocol = "ubx"
transport = { kind = "udp", port = 29602 }
[[device]]
name = "pps"
role = "time"
protocol = "pps"
transport = { kind = "pps", port = ")" +
         pulses.string() + R"(" }
[simulation]
duration_s = 600.0
[simulation.reference]
latency_ms = 3.0
[[simulation.imu]]
name = "ins"
rotation_vector_b_s_deg = [0.0, 0.0, 0.0]
)";
}

const nlohmann::json& device(const nlohmann::json& run, const std::string& name) {
  for (const auto& one : run.at("devices")) {
    if (one.at("name") == name) return one;
  }
  static const nlohmann::json kNone;
  ADD_FAILURE() << name;
  return kNone;
}

TEST(TimeDevices, PulsesAndKernelStampsTellTheTimeOfARunAndReplayAlike) {
  if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
  const auto folder = scratch_folder();
  const auto pulses = folder / "pps0";
  std::ofstream(folder / "car.toml") << vehicle(pulses);
  const auto set_clock = [&](char mode) { std::ofstream(folder / "control") << mode; };
  set_clock('-');
  BackgroundProgram car("imusim", {"live", (folder / "car.toml").string(), "--skip-static"},
                        folder / "imusim.log");
  std::this_thread::sleep_for(seconds(1));
  const std::string preloaded =
      program_path("libhost_fault.so").string() + ":" + program_path("libpps_device.so").string();
  ::setenv("LD_PRELOAD", preloaded.c_str(), 1);
  ::setenv("HOST_FAULT_CONTROL", (folder / "control").c_str(), 1);
  ::setenv("PPS_DEVICE", pulses.c_str(), 1);
  BackgroundProgram service("imuscope",
                            {"run", (folder / "car.toml").string(), "--out", (folder / "live").string()},
                            folder / "imuscope.log");
  for (const char* variable : {"LD_PRELOAD", "HOST_FAULT_CONTROL", "PPS_DEVICE"}) ::unsetenv(variable);
  std::this_thread::sleep_for(seconds(15));
  set_clock('t');  // the wall clock is an hour ahead
  std::this_thread::sleep_for(seconds(5));
  set_clock('-');
  std::this_thread::sleep_for(seconds(10));
  service.interrupt();
  ASSERT_EQ(service.wait(), 0) << read_text(folder / "imuscope.log");
  car.interrupt();
  car.wait();
  SCOPED_TRACE(read_text(folder / "imuscope.log"));

  const auto run = read_json(folder / "live" / "run.json");
  const auto& scale = run.at("time_scale");
  EXPECT_EQ(scale.at("seconds_of"), "reference") << "its tags know of the delay of its samples";
  const auto& told = scale.at("pulses");
  ASSERT_FALSE(told.is_null());
  EXPECT_GE(told.at("used").get<int>(), 20);
  EXPECT_EQ(told.at("seconds_counted_by"), "device");
  EXPECT_LT(told.at("sd_utc_s").get<double>(), 20e-6);
  // The simulated unit sends 3 ms after it has measured, the simulator looks once a millisecond.
  EXPECT_NEAR(told.at("reference_delay").at("mean_s").get<double>(), 3.5e-3, 3e-3);
  EXPECT_NEAR(told.at("gnss_delay").at("mean_s").get<double>(), 40e-3, 10e-3);
  EXPECT_EQ(device(run, "pps").at("bad_contents"), 0);
  for (const char* name : {"airins", "ins", "gnss"}) {
    const auto& budget = device(run, name).at("time_budget");
    EXPECT_EQ(budget.at("stamped_by"), "kernel") << name;
    EXPECT_GT(budget.at("stamp_lead_s").get<double>(), 0.0) << name;
    EXPECT_EQ(device(run, name).at("clock_resets"), 0) << name;
  }
  EXPECT_NEAR(device(run, "airins").at("time_budget").at("delay_s").get<double>(), 3.5e-3, 3e-3);

  ASSERT_EQ(run_program(
                "imuscope",
                {"replay", (folder / "live" / "capture.lcm").string(), "--out", (folder / "again").string()},
                folder / "replay.log"),
            0)
      << read_text(folder / "replay.log");
  const auto again = read_json(folder / "again" / "run.json");
  EXPECT_EQ(again.at("time_scale"), scale) << "bit for bit";
  for (const char* name : {"errors_ins.csv", "calibration_ins.csv", "navigation.csv"}) {
    const auto live = read_text(folder / "live" / name);
    EXPECT_GT(live.size(), 500U) << name;
    EXPECT_TRUE(live == read_text(folder / "again" / name)) << name << " differs between live and replay";
  }
}

}  // namespace
}  // namespace imuscope::test
