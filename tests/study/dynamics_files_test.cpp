#include "study/dynamics_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "models/noise/model.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kStudyRate_hz = 100.0;

Configuration one_studied_imu() {
  Configuration configuration;
  DeviceConfig study;
  study.name = "mtx1";
  study.role = DeviceRole::kStudy;
  study.rate_hz = kStudyRate_hz;
  configuration.devices = {study};
  return configuration;
}

HostTime study_time(double t_s) { return HostTime{} + from_seconds(t_s); }

/// A vehicle that never rolls, and whose side force is what its forward force is.
ErrorRow row_on_rails(std::int64_t k, std::mt19937& random) {
  std::normal_distribution<double> normal;
  ErrorRow row{};
  row.counter = k;
  row.time = study_time(static_cast<double>(k) / kStudyRate_hz);
  row.gyro_valid = row.accel_valid = true;
  for (auto* v : {&row.predicted_omega_s_radps, &row.omega_dot_s_radps2, &row.omega_ddot_s_radps3,
                  &row.predicted_f_s_mps2, &row.f_dot_s_mps3, &row.e_gyro_radps, &row.e_accel_mps2}) {
    for (double& component : *v) component = normal(random);
  }
  row.predicted_omega_s_radps[0] = 0.0;
  row.predicted_f_s_mps2[1] = row.predicted_f_s_mps2[0];
  return row;
}

DynamicsRegressions of_rails(double moving_s, double length_s) {
  std::vector<RowSpool> rows;
  rows.push_back(RowSpool::create(*OutputFolder::open(test::scratch_folder())).value());
  std::mt19937 random(2);
  for (std::int64_t k = 0; static_cast<double>(k) < length_s * kStudyRate_hz; ++k)
    rows[0].add(row_on_rails(k, random));
  const RegimeTrack motion({"static", "dynamic"},
                           {{study_time(0.0), study_time(length_s - moving_s), 0},
                            {study_time(length_s - moving_s), study_time(length_s), 1}});
  const Configuration configuration = one_studied_imu();
  const noise::ModelSpec model = noise::parse_model("WN").value();
  Regressions regressions(configuration, rows, motion, model);
  work_off(regressions.jobs());
  return std::move(regressions).result();
}

TEST(DynamicsFiles, AConstantAndACollinearCovariateAreSaidOnceForTheSensor) {
  const auto found = of_rails(40.0, 60.0);
  EXPECT_THAT(found.remarks,
              ElementsAre("mtx1: omega_x does not vary in the dynamic part; it has no coefficient",
                          "mtx1: f_y is a combination of the covariates before it; it has no coefficient"));
  ASSERT_EQ(found.regressions.size(), 24U);
  EXPECT_EQ(found.regressions[0].at("n"), 4000) << "of the dynamic part alone";
}

TEST(DynamicsFiles, WithoutADynamicPartThereIsNoRegressionAndThatIsSaid) {
  const auto found = of_rails(0.0, 20.0);
  EXPECT_TRUE(found.regressions.empty());
  EXPECT_THAT(found.remarks, ElementsAre("no regression on the dynamics: there is no dynamic part"));
}

TEST(DynamicsFiles, ADynamicPartOfAFewSamplesGivesNoRegressionAndThatIsSaidForEveryAxis) {
  const auto found = of_rails(0.1, 20.0);
  EXPECT_TRUE(found.regressions.empty());
  EXPECT_THAT(found.remarks,
              Contains(HasSubstr("mtx1 accel_z: no regression on the dynamics: too few rows")));
  EXPECT_EQ(found.remarks.size(), 6U);
}

}  // namespace
}  // namespace imuscope
