/// The scripts of docs/examples, run as somebody new would run them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>
#include <regex>
#include <string>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;

class Examples : public testing::Test {
 protected:
  /// What the script prints. imuscope is on its PATH.
  std::string run(const std::string& script, const std::string& arguments) {
    const std::string said = (folder_ / "said.txt").string();
    const std::string command = "cd '" + folder_.string() + "' && PATH='" +
                                program_path("imuscope").parent_path().string() + "':$PATH '" +
                                source_path("docs/examples/" + script).string() + "' " + arguments + " >'" +
                                said + "' 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << read_text(said);
    return read_text(said);
  }

  std::filesystem::path folder_ = scratch_folder();
};

TEST_F(Examples, AStaticLogBecomesAPageAndTheConfigurationOfFilters) {
  constexpr double kRate_hz = 100.0;
  constexpr double kWhite_radps = 2e-3;  // a sample
  constexpr int kSamples = 120'000;
  {
    std::ofstream log(folder_ / "parked.csv");
    log << "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    for (int i = 0; i < kSamples; ++i) {
      log << i / kRate_hz;
      for (int axis = 0; axis < 3; ++axis) log << ',' << kWhite_radps * normal(random);
      for (int axis = 0; axis < 3; ++axis) log << ',' << 0.01 * normal(random) + (axis == 2 ? 9.81 : 0.0);
      log << '\n';
    }
  }
  EXPECT_THAT(run("static_log.sh", "parked.csv page"), HasSubstr("certificate.html"));
  const std::string kalibr = read_text(folder_ / "page" / "kalibr.txt");
  std::smatch density;
  ASSERT_TRUE(std::regex_search(kalibr, density, std::regex("gyroscope_noise_density: *([0-9.e+-]+)")))
      << kalibr;
  EXPECT_NEAR(std::stod(density[1]), kWhite_radps / std::sqrt(kRate_hz),
              0.03 * kWhite_radps / std::sqrt(kRate_hz));
}

TEST_F(Examples, SeveralDrivesAreStudiedAndOneRunIsRead) {
  for (const char* seed : {"21", "22"}) {
    ASSERT_EQ(run_program("imusim",
                          {"record", source_path("config/demo.toml").string(), "--minutes", "3", "--seed",
                           seed, "--out", (folder_ / seed).string()},
                          folder_ / "imusim.log"),
              0);
    std::filesystem::rename(folder_ / seed / "capture.lcm", folder_ / (std::string("drive") + seed + ".lcm"));
  }
  const std::string combined = run("several_drives.sh", "all drive21.lcm drive22.lcm");
  EXPECT_THAT(combined, HasSubstr("mtx1"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "all" / "comparison.html"));
  const std::string read = run("read_run.py", "all/drive21");
  // The lever arm that the simulator knows, within four of its sd.
  const auto truth = read_json(folder_ / "21" / "truth.json");
  const std::regex pattern("mtx1: lever arm ([-0-9.]+) \\+- ([0-9.]+)");
  std::smatch found;
  ASSERT_TRUE(std::regex_search(read, found, pattern)) << read;
  for (const auto& imu : truth.at("imus")) {
    if (imu.at("name") != "mtx1") continue;
    EXPECT_NEAR(std::stod(found[1]), 1e3 * imu.at("r_bs_b_m").at(0).get<double>(),
                4.0 * std::stod(found[2]) + 0.1);
  }
  EXPECT_THAT(read, HasSubstr("static: gyro_x_radps"));
  EXPECT_THAT(read, HasSubstr("dynamic: gyro_x_radps"));
}

}  // namespace
}  // namespace imuscope::test
