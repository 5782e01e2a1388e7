/// Six S-IMUs of 1 kHz on serial lines, live: nothing is lost, every sample has its row, and the capture
/// replays to the same rows. What it costs is printed beside three S-IMUs of 100 Hz.

#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "programs.h"
#include "status_listener.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::seconds;

constexpr double kFast_hz = 1000.0;
constexpr seconds kSettle{10};

/// With IMUSCOPE_LONG_RATES ten minutes.
seconds measured() { return std::getenv("IMUSCOPE_LONG_RATES") == nullptr ? seconds(15) : seconds(600); }

struct Vehicle {
  int imus;
  double rate_hz;
};

std::string name_of(int imu) { return "imu" + std::to_string(imu); }

std::string configuration(const std::filesystem::path& folder, const Vehicle& vehicle) {
  std::ostringstream text;
  const auto device = [&](const std::string& name, const char* role, double rate_hz) {
    text << "[[device]]\nname = \"" << name << "\"\nrole = \"" << role
         << "\"\nprotocol = \"ixblue_stdbin\"\nrate_hz = " << rate_hz
         << ".0\ntransport = { kind = \"serial\", port = " << folder / "ports" / name
         << ", baud = 2000000 }\n";
  };
  text << "[run]\nname = \"fast\"\n";
  device("airins", "reference", 200.0);
  text << "axes = \"+x -y -z\"\n";
  for (int i = 0; i < vehicle.imus; ++i) {
    device(name_of(i), "study", vehicle.rate_hz);
    text << "prior = { rotation_vector_b_s_deg = [0.8, -1.1, 0.6], boresight_sd_deg = 3.0, lever_arm_sd_m = "
            "0.5, "
            "time_offset_ms = 0.0, time_offset_sd_ms = 10.0 }\n";
  }
  text << "[simulation]\nduration_s = 2400.0\n";
  for (int i = 0; i < vehicle.imus; ++i) {
    text << "[[simulation.imu]]\nname = \"" << name_of(i)
         << "\"\nrotation_vector_b_s_deg = [0.8, -1.1, 0.6]\nlever_arm_b_m = [0.35, -0.22, 0.12]\n";
  }
  return text.str();
}

/// Processor time of a program so far, all threads.
double processor_s(pid_t process) {
  const std::string stat = read_text("/proc/" + std::to_string(process) + "/stat");
  std::istringstream fields(stat.substr(stat.rfind(')') + 1));
  std::string skipped;
  constexpr int kBeforeUserTime = 11;  // proc(5): fields 3 to 13
  for (int i = 0; i < kBeforeUserTime; ++i) fields >> skipped;
  double user = 0.0;
  double system = 0.0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

std::size_t rows_of(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) - 1;
}

/// @return share of one processor
double run(const std::filesystem::path& folder, const Vehicle& vehicle) {
  std::filesystem::create_directories(folder);
  const std::string file = (folder / "car.toml").string();
  std::ofstream(file) << configuration(folder, vehicle);
  BackgroundProgram simulator("imusim", {"live", file, "--skip-static"}, folder / "imusim.log");
  std::this_thread::sleep_for(seconds(1));  // its ports are there
  BackgroundProgram service("imuscope", {"run", file, "--out", (folder / "live").string()},
                            folder / "imuscope.log");
  std::this_thread::sleep_for(kSettle);
  const double before_s = processor_s(service.id());
  std::this_thread::sleep_for(measured());
  const double share = (processor_s(service.id()) - before_s) / static_cast<double>(measured().count());
  service.interrupt();
  EXPECT_EQ(service.wait(), 0) << read_text(folder / "imuscope.log");
  simulator.interrupt();
  simulator.wait();
  std::printf("%d S-IMUs of %.0f Hz: %.1f %% of a processor\n", vehicle.imus, vehicle.rate_hz, 100.0 * share);
  return share;
}

TEST(FastImus, SixOfOneKilohertzLoseNothing) {
  if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
  const auto folder = scratch_folder();
  const double slow = run(folder / "slow", {3, 100.0});
  const Vehicle vehicle{6, kFast_hz};
  const double fast = run(folder / "fast", vehicle);
  // Twenty times as many samples; what they share costs nothing more.
  EXPECT_LT(fast, 20.0 * slow);

  const auto live = folder / "fast" / "live";
  SCOPED_TRACE(read_text(folder / "fast" / "imuscope.log"));
  for (const auto& device : read_json(live / "run.json").at("devices")) {
    const auto name = device.at("name").get<std::string>();
    for (const char* count : {"samples_lost", "refused", "frames_dropped", "bad_checksums", "clock_resets"})
      EXPECT_EQ(device.at(count), 0) << name << ": " << count;
    if (device.at("role") != "study") continue;
    EXPECT_EQ(device.at("late"), 0) << name;
    const auto samples = device.at("samples").get<double>();
    EXPECT_GT(samples, kFast_hz * static_cast<double>((kSettle + measured()).count()));
    EXPECT_GT(static_cast<double>(rows_of(live / ("errors_" + name + ".csv"))),
              kFast_hz * static_cast<double>(measured().count()))
        << name;
  }
  ASSERT_EQ(run_program("imuscope",
                        {"replay", (live / "capture.lcm").string(), "--out", (folder / "again").string()},
                        folder / "replay.log"),
            0)
      << read_text(folder / "replay.log");
  for (int i = 0; i < vehicle.imus; ++i) {
    const std::string errors = "errors_" + name_of(i) + ".csv";
    EXPECT_TRUE(read_text(live / errors) == read_text(folder / "again" / errors)) << errors;
  }
}

}  // namespace
}  // namespace imuscope::test
