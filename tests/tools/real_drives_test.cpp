/// Recorded drives and hand-swung pairs with known mountings, by the committed configurations: what is found
/// must lie within three published sd and the known value's own spread, and the sd must be those of such
/// sensors. Known values: independent batch estimates, kept with the recordings.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/shared_data.h"

namespace {

using imuscope::test::program_path;
using imuscope::test::scratch_folder;
using imuscope::test::shared_path;
using imuscope::test::source_path;
using nlohmann::json;

struct Expected {
  std::array<double, 3> euler_spread_deg;
  double r_spread_m;
  double sd_euler_max_deg;  ///< more would say that the recording shows nothing
  double sd_r_max_m;
  double
      sd_min_share;  ///< of the spread: a real sensor's sd is not a hundredth of what two estimates differ by
};

Expected expected_of(const std::string& recording) {
  if (recording.rfind("car", 0) == 0) return {{0.05, 0.18, 0.08}, 0.004, 0.5, 0.02, 0.3};
  return {{0.1, 0.1, 0.1}, 0.003, 0.05, 0.002, 0.03};
}

TEST(RealDrives, EveryComponentLiesWithinThreeSdAndTheKnownValuesSpreadAndTheSdAreBelievable) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  IMUSCOPE_NEEDS_SHARED("data/xsens_pair");
  const auto out = scratch_folder() / "table.json";
  const std::string command = "'" + program_path("imuscope_real_drives").string() + "' '" +
                              shared_path("data").string() + "' --config '" + source_path("config").string() +
                              "' --json >'" + out.string() + "'";
  const int status = std::system(command.c_str());
  ASSERT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  std::ifstream in(out);
  const json table = json::parse(in);
  ASSERT_EQ(table.at("recordings").size(), 6U);
  double normalised = 0.0;
  int n = 0;
  for (const auto& row : table.at("recordings")) {
    const std::string name = row.at("recording");
    const Expected expected = expected_of(name);
    for (std::size_t i = 0; i < 3; ++i) {
      const double angle = row.at("error").at("euler_deg").at(i);
      const double angle_sd = row.at("sd").at("euler_deg").at(i);
      const double r = row.at("error").at("r_m").at(i);
      const double r_sd = row.at("sd").at("r_m").at(i);
      EXPECT_LE(std::abs(angle), 3.0 * angle_sd + expected.euler_spread_deg[i]) << name << ", angle " << i;
      EXPECT_LE(std::abs(r), 3.0 * r_sd + expected.r_spread_m) << name << ", lever arm " << i;
      EXPECT_LT(angle_sd, expected.sd_euler_max_deg) << name << ", angle " << i;
      EXPECT_LT(r_sd, expected.sd_r_max_m) << name << ", lever arm " << i;
      EXPECT_GT(angle_sd, expected.sd_min_share * expected.euler_spread_deg[i]) << name << ", angle " << i;
      EXPECT_GT(r_sd, expected.sd_min_share * expected.r_spread_m) << name << ", lever arm " << i;
      normalised += angle * angle / (angle_sd * angle_sd + std::pow(expected.euler_spread_deg[i], 2));
      normalised += r * r / (r_sd * r_sd + std::pow(expected.r_spread_m, 2));
      n += 2;
    }
    const double t_d = row.at("error").at("t_d_s");
    EXPECT_LE(std::abs(t_d), 3.0 * row.at("sd").at("t_d_s").get<double>() + 0.001) << name;
    EXPECT_EQ(row.at("resets"), 0) << name;
  }
  // Over all recordings the errors are those that sd and spread together promise, neither a tenth nor thrice.
  EXPECT_GT(normalised / n, 0.1);
  EXPECT_LT(normalised / n, 3.0);
}

}  // namespace
