/// `imuscope combine` as a user meets it: output, messages and exit codes.

#include <gmock/gmock.h>
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
using nlohmann::json;
using testing::HasSubstr;

constexpr double kRadPerDeg = 3.14159265358979323846 / 180.0;

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Row-major matrix of a rotation about z: C_b_s = Exp(-psi_z).
std::array<double, 9> about_z(double psi_rad) {
  const double c = std::cos(psi_rad);
  const double s = std::sin(psi_rad);
  return {c, s, 0, -s, c, 0, 0, 0, 1};
}

class CombineCommand : public testing::Test {
 protected:
  /// A finished run with one S-IMU whose boresight errors are independent of its lever arm.
  std::string run_with(const std::string& name, double psi_z_rad, double r_x_m, double sd_psi_rad,
                       double sd_r_m, const std::string& input, const std::string& imu = "mtx1",
                       const std::string& status = "calibrated") const {
    std::array<double, 36> P{};
    for (std::size_t i = 0; i < 3; ++i) {
      P[7 * i] = sd_psi_rad * sd_psi_rad;
      P[7 * (i + 3)] = sd_r_m * sd_r_m;
    }
    std::filesystem::create_directories(folder_ / name);
    const json calibration{{"schema", "imuscope.calibration/1"},
                           {"imus",
                            {{{"name", imu},
                              {"status", status},
                              {"C_b_s", about_z(psi_z_rad)},
                              {"r_bs_b_m", {r_x_m, 0.0, 0.0}},
                              {"covariance_psi_r", P}}}}};
    std::ofstream(folder_ / name / "calibration.json") << calibration.dump();
    std::ofstream(folder_ / name / "run.json")
        << json{{"schema", "imuscope.run/1"}, {"inputs", {input}}}.dump();
    return "'" + (folder_ / name).string() + "' ";
  }

  Outcome combine(const std::string& arguments) const {
    const auto out = folder_ / "stdout.txt";
    const auto err = folder_ / "stderr.txt";
    const std::string command = "'" + program_path("imuscope").string() + "' combine " + arguments + " >'" +
                                out.string() + "' 2>'" + err.string() + "'";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(out), read_file(err)};
  }

  std::filesystem::path folder_ = scratch_folder();
};

TEST_F(CombineCommand, WeighsIndependentDrivesByInverseVarianceAndTestsWhetherTheyAgree) {
  // Weights 1/1 and 1/4 of the squared sd, the closed form of two independent values, if the mounting repeats
  // exactly; the less it does, the more alike they count.
  const auto runs =
      run_with("a", 1e-3, 0.100, 1e-4, 1e-3, "a.lcm") + run_with("b", 1.1e-3, 0.105, 2e-4, 2e-3, "b.lcm");
  const auto outcome = combine(runs + "--json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto document = json::parse(outcome.out);
  EXPECT_EQ(document.at("schema"), "imuscope.combined/1");
  EXPECT_EQ(document.at("method"), "inverse variance");
  const auto& imu = document.at("imus").at(0);
  EXPECT_EQ(imu.at("name"), "mtx1");
  const double psi_z = std::asin(imu.at("C_b_s").at(1).get<double>());
  EXPECT_GT(psi_z, (4.0 * 1e-3 + 1.1e-3) / 5.0);
  EXPECT_LT(psi_z, (1e-3 + 1.1e-3) / 2.0);
  EXPECT_GT(imu.at("r_bs_b_m").at(0).get<double>(), (4.0 * 0.100 + 0.105) / 5.0);
  EXPECT_LT(imu.at("r_bs_b_m").at(0).get<double>(), (0.100 + 0.105) / 2.0);
  EXPECT_GT(imu.at("boresight_sd_deg").at(2).get<double>(), 1e-4 * std::sqrt(0.8) / kRadPerDeg);
  EXPECT_LT(imu.at("boresight_sd_deg").at(2).get<double>(), 2e-4 / kRadPerDeg);
  EXPECT_GT(imu.at("r_bs_b_sd_m").at(0).get<double>(), 1e-3 * std::sqrt(0.8));
  EXPECT_LT(imu.at("r_bs_b_sd_m").at(0).get<double>(), 1.2e-3);
  EXPECT_GT(imu.at("between_drives").at("r_sd_m").get<double>(), 0.0);
  EXPECT_LT(imu.at("between_drives").at("r_sd_m").get<double>(), 1e-3);
  // Differences of 1e-4 rad and 5 mm with sd sqrt(5) of 1e-4 rad and 1 mm: chi2 = 1/5 + 25/5.
  EXPECT_NEAR(imu.at("homogeneity").at("chi2").get<double>(), 5.2, 1e-6);
  EXPECT_EQ(imu.at("homogeneity").at("dof"), 6);
  // Of a chi-square with 6 degrees of freedom: exp(-x/2) (1 + x/2 + (x/2)^2/2).
  EXPECT_NEAR(imu.at("homogeneity").at("p_value").get<double>(),
              std::exp(-2.6) * (1.0 + 2.6 + 0.5 * 2.6 * 2.6), 1e-6);
  EXPECT_NEAR(imu.at("drives").at(1).at("r_from_others_m").at(0).get<double>(), 0.005, 1e-12);
  // Half a millimetre of give in each of the two.
  const double between_m = imu.at("drives").at(1).at("r_from_others_sd_m").at(0).get<double>();
  EXPECT_GT(between_m, 1e-3 * std::sqrt(5.0));
  EXPECT_LT(between_m, 1e-3 * std::sqrt(5.0 + 2.0 * 0.25 * 2.0));
}

TEST_F(CombineCommand, SaysInWordsThatDrivesDidNotSeeOneMountingAndWhichStandsOut) {
  const auto runs = run_with("a", 0.0, 0.1, 1e-4, 1e-3, "a.lcm") +
                    run_with("b", 0.0, 0.1, 1e-4, 1e-3, "b.lcm") +
                    run_with("moved", 2e-2, 0.1, 1e-4, 1e-3, "c.lcm");
  const auto outcome = combine(runs);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("differ by more than their sd allow"));
  const auto moved = outcome.out.find("moved");
  ASSERT_NE(moved, std::string::npos);
  EXPECT_NE(outcome.out.find("stands out", moved), std::string::npos);
}

TEST_F(CombineCommand, IntersectsWhereDrivesReadTheSameFileOrAreSaidToBeCorrelated) {
  const auto runs =
      run_with("a", 0.0, 0.1, 1e-4, 1e-3, "a.lcm") + run_with("b", 0.0, 0.1, 1e-4, 1e-3, "a.lcm");
  const auto found_out = combine(runs + "--json");
  ASSERT_EQ(found_out.exit_code, 0) << found_out.err;
  const auto document = json::parse(found_out.out);
  EXPECT_EQ(document.at("method"), "covariance intersection");
  EXPECT_THAT(document.at("remarks").at(0).get<std::string>(), HasSubstr("read the same file"));
  // Twice the same says no more than once.
  EXPECT_NEAR(document.at("imus").at(0).at("r_bs_b_sd_m").at(0).get<double>(), 1e-3, 1e-9);

  const auto others =
      run_with("c", 0.0, 0.1, 1e-4, 1e-3, "c.lcm") + run_with("d", 0.0, 0.1, 1e-4, 1e-3, "d.lcm");
  EXPECT_EQ(json::parse(combine(others + "--correlated --json").out).at("method"), "covariance intersection");
  EXPECT_EQ(json::parse(combine(runs + "--independent --json").out).at("method"), "inverse variance");
}

TEST_F(CombineCommand, TellsWhatIsWrongWithAFolderInOneSentence) {
  const auto good = run_with("good", 0.0, 0.1, 1e-4, 1e-3, "a.lcm");
  const auto one = combine(good);
  EXPECT_EQ(one.exit_code, 2) << one.err;
  EXPECT_THAT(one.err, HasSubstr("RUN_DIR"));

  const auto absent = combine(good + "'" + (folder_ / "absent").string() + "'");
  EXPECT_EQ(absent.exit_code, 1);
  EXPECT_THAT(absent.err, HasSubstr("absent"));
  EXPECT_THAT(absent.err, HasSubstr("imuscope process"));

  const auto broken = run_with("broken", 0.0, 0.1, 1e-4, 1e-3, "b.lcm");
  std::ofstream(folder_ / "broken" / "calibration.json") << "{ not json";
  const auto not_json = combine(good + broken);
  EXPECT_EQ(not_json.exit_code, 1);
  EXPECT_THAT(not_json.err, HasSubstr("calibration.json is not a JSON object"));

  const auto lacking = run_with("lacking", 0.0, 0.1, 1e-4, 1e-3, "b.lcm");
  auto document = json::parse(read_file(folder_ / "lacking" / "calibration.json"));
  document["imus"][0]["covariance_psi_r"][3] = nullptr;
  std::ofstream(folder_ / "lacking" / "calibration.json") << document.dump();
  const auto field = combine(good + lacking);
  EXPECT_EQ(field.exit_code, 1);
  EXPECT_THAT(field.err, HasSubstr("covariance_psi_r of mtx1"));

  const auto singular = combine(good + run_with("singular", 0.0, 0.1, 0.0, 1e-3, "b.lcm"));
  EXPECT_EQ(singular.exit_code, 1);
  EXPECT_THAT(singular.err, HasSubstr("not positive definite"));

  const auto other = combine(good + run_with("other", 0.0, 0.1, 1e-4, 1e-3, "b.lcm", "mtx2"));
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.err, HasSubstr("no S-IMU was calibrated in two of these runs"));
  const auto waiting = combine(good + run_with("waiting", 0.0, 0.1, 1e-4, 1e-3, "b.lcm", "mtx1", "coarse"));
  EXPECT_EQ(waiting.exit_code, 1);
}

}  // namespace
