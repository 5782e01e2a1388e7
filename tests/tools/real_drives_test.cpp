/// Recorded drives and hand-swung pairs with known mountings, by the committed configurations, which name no
/// noise: what is found must lie within three sd of both, and the sd must be those of such sensors. Known
/// values: independent batch estimates, kept with the recordings.

#include <gtest/gtest.h>
#include <sys/wait.h>

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

/// More would say that the recording shows nothing; less than a share of what two estimates differ by is no
/// real sensor's.
struct Believable {
  double sd_euler_max_deg;
  double sd_r_max_m;
  double sd_min_share;
};

Believable believable(const std::string& recording) {
  if (recording.starts_with("car")) return {0.5, 0.02, 0.1};
  if (recording.starts_with("rc")) return {0.5, 0.002, 0.02};
  // Two equal units, the axes of each good to 0.1 deg.
  return {0.25, 0.002, 0.02};
}

json table_of_real_drives() {
  const auto out = scratch_folder() / "table.json";
  const std::string command = "'" + program_path("imuscope_real_drives").string() + "' '" +
                              shared_path("data").string() + "' --config '" + source_path("config").string() +
                              "' --json >'" + out.string() + "'";
  const int status = std::system(command.c_str());
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  std::ifstream in(out);
  return json::parse(in);
}

TEST(RealDrives, EveryMountingIsFoundItsErrorsAreWhatItsSdPromiseAndItsDrivesAgree) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  IMUSCOPE_NEEDS_SHARED("data/rc_car");
  IMUSCOPE_NEEDS_SHARED("data/xsens_pair");
  const json table = table_of_real_drives();
  const json& counts = table.at("counts");
  EXPECT_EQ(counts.at("mountings"), 17);
  EXPECT_EQ(counts.at("found"), 17);
  const double inside = counts.at("inside").get<double>() / counts.at("components").get<double>();
  EXPECT_GE(inside, 0.95);
  EXPECT_GT(counts.at("mean_z2").get<double>(), 0.5);
  EXPECT_LT(counts.at("mean_z2").get<double>(), 1.5);
  EXPECT_EQ(counts.at("rejected"), 0) << "drives of one mounting";
  EXPECT_EQ(counts.at("false_claims"), 0) << "filters that say calibrated, far off";

  int batches = 0;
  for (const auto& row : table.at("recordings")) {
    if (!row.at("batch").is_object()) continue;
    ++batches;
    const std::string name = row.at("recording");
    const Believable limits = believable(name);
    const json& sd = row.at("batch").at("sd");
    const json& known = row.at("batch").at("known_sd");
    for (std::size_t i = 0; i < 3; ++i) {
      const double angle_sd = sd.at("euler_deg").at(i);
      const double r_sd = sd.at("r_m").at(i);
      EXPECT_LT(angle_sd, limits.sd_euler_max_deg) << name << ", angle " << i;
      EXPECT_LT(r_sd, limits.sd_r_max_m) << name << ", lever arm " << i;
      EXPECT_GT(angle_sd, limits.sd_min_share * known.at("euler_deg").at(i).get<double>())
          << name << ' ' << i;
      EXPECT_GT(r_sd, limits.sd_min_share * known.at("r_m").at(i).get<double>()) << name << ' ' << i;
    }
    if (!name.starts_with("rc")) {
      const double t_d = row.at("batch").at("error").at("t_d_s");
      EXPECT_LE(std::abs(t_d), 3.0 * sd.at("t_d_s").get<double>() + 0.001) << name;
    }
  }
  EXPECT_GE(batches, 16) << "one pair is shorter than the batch takes";
  for (const auto& mounting : table.at("mountings")) {
    EXPECT_LT(mounting.at("between_drives_deg").get<double>(), 0.2);
    EXPECT_LT(mounting.at("between_drives_m").get<double>(), 0.002);
  }
}

}  // namespace
