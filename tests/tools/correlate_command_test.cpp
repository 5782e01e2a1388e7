/// `imuscope correlate`: what S-IMUs of a run have in common, found among what is each one's own, in the
/// reference's frame.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "configuration/config.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr double kRate_hz = 100.0;
constexpr int kSamples = 30'000;
constexpr double kCommon_radps = 2e-3;  // along x of b, white

/// Three sensors in different attitudes, each with white noise of its own; none of them on the others'
/// instants.
class CorrelateCommand : public testing::Test {
 protected:
  void SetUp() override {
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal;
    std::vector<double> common(kSamples);
    for (double& v : common) v = kCommon_radps * normal(random);
    json calibration{{"imus", json::array()}};
    for (int imu = 0; imu < 3; ++imu) {
      const std::string name = "mtx" + std::to_string(imu + 1);
      const Eigen::Matrix3d C_b_s =
          Eigen::AngleAxisd(0.5 * imu + 0.3, Eigen::Vector3d(1.0, 2.0 - imu, 0.5).normalized())
              .toRotationMatrix();
      json rows = json::array();
      for (Eigen::Index i = 0; i < 9; ++i) rows.push_back(C_b_s(i / 3, i % 3));
      calibration["imus"].push_back({{"name", name}, {"C_b_s", rows}});
      std::ofstream errors(folder_ / ("errors_" + name + ".csv"));
      errors.precision(12);
      errors << "time_s,utc_s,counter,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_"
                "mps2,"
                "e_accel_z_mps2,regime\n";
      for (int i = 0; i < kSamples; ++i) {
        Eigen::Vector3d e_s = C_b_s * Eigen::Vector3d(common[static_cast<std::size_t>(i)], 0.0, 0.0);
        for (double& v : e_s) v += own_radps(imu) * normal(random);
        errors << i / kRate_hz + 0.002 * imu << ",," << i;
        for (const double v : e_s) errors << ',' << v;
        for (int axis = 0; axis < 3; ++axis) errors << ',' << 0.01 * normal(random);
        errors << (i % 10'000 < 9'000 ? ",static\n" : ",dynamic\n");
      }
    }
    std::ofstream(folder_ / "calibration.json") << calibration.dump();
  }

  static double own_radps(int imu) { return 1e-3 * (imu + 2.0); }

  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "correlate");
    return run_program("imuscope", arguments, folder_ / "said.txt");
  }
  [[nodiscard]] std::string said() const { return read_text(folder_ / "said.txt"); }

  std::filesystem::path folder_ = scratch_folder();
};

TEST_F(CorrelateCommand, FindsTheReferencesNoiseInItsOwnFrame) {
  ASSERT_EQ(run({folder_.string(), "--json"}), 0) << said();
  const json document = json::parse(said());
  // White noise: half its variance at the first scale.
  const auto first = [&](const char* axis) { return document.at("axes").at(axis).at("scales").at(0); };
  const double common = 0.5 * kCommon_radps * kCommon_radps;
  const json x = first("gyro_x").at("common");
  EXPECT_LT(x.at("ci_low"), common);
  EXPECT_GT(x.at("ci_high"), common);
  EXPECT_NEAR(x.at("value").get<double>(), common, 0.06 * common);
  EXPECT_LT(std::abs(first("gyro_y").at("common").at("value").get<double>()), 0.06 * common)
      << "it is along x alone";
  for (int imu = 0; imu < 3; ++imu) {
    const double own = 0.5 * own_radps(imu) * own_radps(imu);
    EXPECT_NEAR(first("gyro_x").at("own").at(static_cast<std::size_t>(imu)).at("value").get<double>(), own,
                0.06 * own);
  }
  // Inverse variances of what is each one's own.
  const json mean = document.at("axes").at("gyro_x").at("mean");
  double sum = 0.0;
  for (int imu = 0; imu < 3; ++imu) sum += 1.0 / (own_radps(imu) * own_radps(imu));
  EXPECT_NEAR(mean.at("weights").at(0).get<double>(), 1.0 / (own_radps(0) * own_radps(0)) / sum, 0.03);
  EXPECT_LT(mean.at("held_out"), 0.97);
  EXPECT_LT(document.at("axes").at("gyro_x").at("pairs").at(0).at("p_holm"), 1e-6);
  EXPECT_GT(document.at("axes").at("gyro_y").at("pairs").at(0).at("p_holm"), 1e-3);
}

TEST_F(CorrelateCommand, PrintsATableThatAPersonReads) {
  ASSERT_EQ(run({folder_.string()}), 0) << said();
  EXPECT_THAT(said(), HasSubstr("gyro_x, deg/s, about b"));
  EXPECT_THAT(said(), HasSubstr("mtx2 alone"));
  EXPECT_THAT(said(), HasSubstr("quietest mean from 0.02 to"));
  EXPECT_NE(said().find("mtx1 and mtx2: coherence 0.4"), std::string::npos);
}

TEST_F(CorrelateCommand, WhatItWritesForTheConfigurationIsOne) {
  ASSERT_EQ(run({folder_.string(), "--json"}), 0) << said();
  const json axes = json::parse(said()).at("axes");
  ASSERT_EQ(run({folder_.string()}), 0) << said();
  const std::string printed = said();
  const auto begin = printed.find("[virtual_imu]");
  ASSERT_NE(begin, std::string::npos) << printed;
  std::string text = "[[device]]\nname = \"airins\"\nrole = \"reference\"\nprotocol = \"csv_imu\"\n";
  for (const char* name : {"mtx1", "mtx2", "mtx3"})
    text += fmt::format("[[device]]\nname = \"{}\"\nrole = \"study\"\nprotocol = \"csv_imu\"\n", name);
  const auto configuration = parse_configuration(text + printed.substr(begin), "printed.toml");
  ASSERT_TRUE(configuration) << configuration.error().text();
  ASSERT_EQ(configuration->virtual_imu.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(configuration->virtual_imu[i].gyro[0],
                axes.at("gyro_x").at("mean").at("weights").at(i).get<double>(), 2e-4);
    EXPECT_NEAR(configuration->virtual_imu[i].accel[2],
                axes.at("accel_z").at("mean").at("weights").at(i).get<double>(), 2e-4);
  }
}

TEST_F(CorrelateCommand, OfALogTheAxesAreHeldAgainstEachOther) {
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  std::ofstream log(folder_ / "log.csv");
  log << "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps\n";
  for (int i = 0; i < kSamples; ++i) {
    const double leaks = normal(random);
    log << i / kRate_hz << ',' << leaks << ',' << 0.1 * leaks + normal(random) << ',' << normal(random)
        << '\n';
  }
  log.close();
  ASSERT_EQ(run({(folder_ / "log.csv").string()}), 0) << said();
  EXPECT_THAT(said(), HasSubstr("gyro_x and gyro_y: coherence 0.1"));
  EXPECT_THAT(said(), HasSubstr("gyro_x and gyro_z: nothing in common that shows"));
}

TEST_F(CorrelateCommand, WhatCannotBeDoneIsToldWithWhatToDo) {
  EXPECT_EQ(run({folder_.string(), "--name", "mtx9"}), 2);
  EXPECT_THAT(said(), HasSubstr("there is mtx1, mtx2, mtx3"));
  EXPECT_EQ(run({folder_.string(), "--name", "mtx1"}), 1);
  EXPECT_THAT(said(), HasSubstr("there is one signal alone"));
  EXPECT_EQ(run({folder_.string(), "--from", "1000"}), 2);
  EXPECT_THAT(said(), HasSubstr("choose shorter scales"));
  EXPECT_EQ(run({folder_.string(), "--regime", "flying"}), 1);
  std::filesystem::create_directory(folder_ / "empty");
  EXPECT_EQ(run({(folder_ / "empty").string()}), 2);
  EXPECT_THAT(said(), HasSubstr("holds no errors_NAME.csv"));
  std::ofstream(folder_ / "calibration.json") << R"({"imus": [{"name": "mtx1", "C_b_s": [1, 2]}]})";
  EXPECT_EQ(run({folder_.string()}), 2);
  EXPECT_THAT(said(), HasSubstr("no mounting of mtx1"));
}

}  // namespace
}  // namespace imuscope::test
