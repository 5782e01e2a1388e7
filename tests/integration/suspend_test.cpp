/// The PC is suspended for half a minute in the midst of a drive: its clock stands still, the devices go on,
/// what they send is lost. The run knows of the time that is missing, loses no mounting, and UTC is right
/// after it.

#include <gtest/gtest.h>
#include <cmath>
#include <fstream>
#include <sstream>

#include "demo_vehicle.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

constexpr double kSuspendAt_s = 200.0;
constexpr double kSuspendFor_s = 30.0;

TEST(Suspend, LeavesMountingsAloneAndUtcRight) {
  const auto folder = scratch_folder();
  const auto config = DemoVehicle()
                          .set("simulation.line.suspend_at_s", kSuspendAt_s)
                          .set("simulation.line.suspend_for_s", kSuspendFor_s)
                          .write(folder / "car.toml");
  const auto drive = folder / "drive";
  ASSERT_EQ(run_program("imusim", {"record", config.string(), "--minutes", "6", "--out", drive.string()},
                        folder / "imusim.log"),
            0)
      << read_text(folder / "imusim.log");
  const auto out = folder / "run";
  ASSERT_EQ(run_program("imuscope", {"replay", (drive / "capture.lcm").string(), "--out", out.string()},
                        folder / "replay.log"),
            0)
      << read_text(folder / "replay.log");
  const auto run = read_json(out / "run.json");
  double stopped_s = 0.0;
  double started_s = 0.0;
  for (const auto& event : run.at("events")) {
    const auto said = event.at("text").get<std::string>();
    EXPECT_EQ(said.find("sits differently"), std::string::npos) << said;
    EXPECT_EQ(said.find("calibrated anew"), std::string::npos) << said;
    EXPECT_EQ(said.find("rejected"), std::string::npos) << said << ": as if nothing had been missing";
    const double time_s = event.at("time_s").get<double>();
    if (said.find("navigation stopped: the reference was silent for 30") == 0) stopped_s = time_s;
    if (said.find("navigation started") == 0) started_s = time_s;
    std::printf("%8.1f %s\n", time_s, said.c_str());
  }
  EXPECT_NEAR(stopped_s, kSuspendAt_s, 1.0) << "by the host's clock, which stood still";
  EXPECT_GT(started_s, stopped_s);
  // UTC of the rows goes on where the devices have it: no row is of the time that is missing.
  std::ifstream rows(out / "errors_mtx1.csv");
  std::string line;
  std::getline(rows, line);
  std::istringstream header(line);
  std::size_t utc_column = 0;
  for (std::string name; std::getline(header, name, ',') && name != "utc_s"; ++utc_column) {
  }
  double before = std::nan("");
  double longest = 0.0;
  while (std::getline(rows, line)) {
    std::istringstream fields(line);
    std::string field;
    for (std::size_t i = 0; i <= utc_column; ++i) std::getline(fields, field, ',');
    if (field.empty()) continue;
    const double utc_s = std::stod(field);
    if (!std::isnan(before)) longest = std::max(longest, utc_s - before);
    before = utc_s;
  }
  EXPECT_NEAR(longest, kSuspendFor_s, 1.0);
  EXPECT_GE(run.at("time_scale").at("steps").get<int>(), 1);
}

}  // namespace
}  // namespace imuscope::test
