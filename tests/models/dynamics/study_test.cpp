#include "models/dynamics/study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <utility>
#include <vector>

#include "given_rows.h"
#include "models/dynamics/covariates.h"
#include "models/dynamics/json.h"

namespace imuscope {
namespace {

/// A drive of band-limited motion; the error of every axis is white noise and a slow Gauss-Markov process.
struct Drive {
  explicit Drive(unsigned seed, std::size_t n = 6000) : generator(seed) {
    constexpr double kPhi = 0.98;
    const double slow = std::exp(-0.05);
    std::array<double, kCovariates> x{};
    std::array<double, kErrorAxes> markov{};
    for (std::size_t i = 0; i < n; ++i) {
      for (double& value : x) value = kPhi * value + std::sqrt(1.0 - kPhi * kPhi) * normal(generator);
      ErrorRow row{};
      row.counter = static_cast<std::int64_t>(i);
      row.gyro_valid = row.accel_valid = true;
      for (std::size_t k = 0; k < 3; ++k) {
        row.predicted_omega_s_radps[k] = x[k];
        row.omega_dot_s_radps2[k] = x[3 + k];
        row.omega_ddot_s_radps3[k] = x[6 + k];
        row.predicted_f_s_mps2[k] = x[9 + k] - (k == 2 ? 9.8 : 0.0);
        row.f_dot_s_mps3[k] = x[12 + k];
      }
      for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
        markov[axis] = slow * markov[axis] + std::sqrt(1.0 - slow * slow) * normal(generator);
        (axis < 3 ? row.e_gyro_radps[axis] : row.e_accel_mps2[axis - 3]) =
            0.3 + markov[axis] + 0.7 * normal(generator);
      }
      rows.push_back(row);
    }
  }
  std::mt19937 generator;
  std::normal_distribution<double> normal;
  std::vector<ErrorRow> rows;
};

DynamicsOptions options() { return {100.0, *noise::parse_model("WN+GM"), 0.95}; }

const RegressionCoefficient* find(const std::optional<Regression>& regression, std::size_t covariate) {
  if (!regression) return nullptr;
  for (const auto& c : regression->coefficients) {
    if (c.covariate == covariate) return &c;
  }
  return nullptr;
}

TEST(StudyDynamics, FindsAPlantedGSensitivityAndLeavesOtherAxesAlone) {
  Drive drive(1);
  constexpr double kPlanted = 0.5;
  for (auto& row : drive.rows) row.e_gyro_radps[0] += kPlanted * row.predicted_f_s_mps2[1];
  test::GivenRows rows(drive.rows);
  const auto result = study_dynamics(rows, options());
  const auto* const c = find(result[0].gls_projected, 10);
  ASSERT_NE(c, nullptr);
  EXPECT_LT(result[0].gls_projected->p_value, 1e-6);
  EXPECT_LT(std::abs(c->value - kPlanted), 4.0 * c->sd);
  EXPECT_GT(kPlanted, 4.0 * c->sd);  // the drive is long enough to see it
  EXPECT_GT(result[1].gls_projected->p_value, 1e-4);
}

// A scale error shows before projection and not after: it is a calibration column.
TEST(StudyDynamics, ProjectionTakesCalibrationErrorsAway) {
  Drive drive(2);
  for (auto& row : drive.rows) {
    row.e_gyro_radps[0] += 0.8 * row.predicted_omega_s_radps[0] - 0.6 * row.omega_dot_s_radps2[0];
  }
  test::GivenRows rows(drive.rows);
  const auto result = study_dynamics(rows, options());
  EXPECT_LT(result[0].gls->p_value, 1e-6);
  EXPECT_GT(result[0].gls_projected->p_value, 1e-3);
  EXPECT_EQ(find(result[0].gls_projected, 0), nullptr);
  ASSERT_NE(find(result[0].gls, 0), nullptr);
  EXPECT_NEAR(find(result[0].gls, 0)->value, 0.8, 4.0 * find(result[0].gls, 0)->sd);
}

TEST(StudyDynamics, GapsAndClippedSamplesAreLeftOut) {
  Drive drive(3);
  std::vector<ErrorRow> rows;
  for (auto row : drive.rows) {
    if (row.counter > 1000 && row.counter < 1500) continue;
    if (row.counter == 2000) {
      row.gyro_valid = false;
      row.e_gyro_radps[0] = 1e9;
    }
    rows.push_back(row);
  }
  test::GivenRows source(rows);
  const auto result = study_dynamics(source, options());
  ASSERT_TRUE(result[0].gls);
  EXPECT_EQ(result[0].ols->n, rows.size() - 1);
  EXPECT_EQ(result[0].gls->n, rows.size() - 1);
  EXPECT_EQ(result[3].gls->n, rows.size());
  // Whitened by the right model the residual has variance 1.
  EXPECT_NEAR(result[0].gls->residual_variance, 1.0, 0.1);
}

TEST(StudyDynamics, StandstillGivesNoRegressionAndNothingIsInvented) {
  Drive drive(4);
  for (auto& row : drive.rows) {
    row.predicted_omega_s_radps = row.omega_dot_s_radps2 = row.omega_ddot_s_radps3 = row.f_dot_s_mps3 = {};
    row.predicted_f_s_mps2 = {0.0, 0.0, -9.8};
  }
  test::GivenRows rows(drive.rows);
  const auto result = study_dynamics(rows, options());
  for (const auto& axis : result) {
    EXPECT_FALSE(axis.ols);
    EXPECT_FALSE(axis.gls_projected);
  }
  nlohmann::json json = nlohmann::json::array();
  append_regressions("mtx1", result, json);
  EXPECT_TRUE(json.empty());
}

/// A vehicle on rails: no rotation about x, and as much force along y as along x.
Drive on_rails(unsigned seed) {
  Drive drive(seed);
  for (auto& row : drive.rows) {
    row.predicted_omega_s_radps[0] = row.omega_dot_s_radps2[0] = row.omega_ddot_s_radps3[0] = 0.0;
    row.predicted_f_s_mps2[1] = row.predicted_f_s_mps2[0];
    row.f_dot_s_mps3[1] = 2.0 * row.f_dot_s_mps3[0] - 0.5 * row.predicted_omega_s_radps[1];
  }
  return drive;
}

TEST(StudyDynamics, ConstantAndCollinearCovariatesAreLeftOutAndTheOthersKeepTheirCoefficients) {
  Drive drive = on_rails(6);
  constexpr double kPlanted = 0.5;
  for (auto& row : drive.rows) row.e_gyro_radps[0] += kPlanted * row.predicted_f_s_mps2[2];
  test::GivenRows rows(drive.rows);
  const auto result = study_dynamics(rows, options());
  using Entry = std::pair<std::size_t, LeftOut>;
  const std::vector<Entry> expected{{0, LeftOut::kConstant},
                                    {3, LeftOut::kConstant},
                                    {6, LeftOut::kConstant},
                                    {10, LeftOut::kCollinear},
                                    {13, LeftOut::kCollinear}};
  for (const auto& axis : result) {
    for (const auto* regression : {&axis.ols, &axis.gls}) {
      ASSERT_TRUE(*regression);
      EXPECT_EQ((*regression)->left_out, expected);
      EXPECT_EQ((*regression)->dof_model, 10);
      EXPECT_EQ((*regression)->coefficients.size(), 10U);
    }
  }
  const auto* c = find(result[0].gls, 11);
  ASSERT_NE(c, nullptr);
  EXPECT_LT(std::abs(c->value - kPlanted), 4.0 * c->sd);
  nlohmann::json json = nlohmann::json::array();
  append_regressions("mtx1", result, json);
  EXPECT_EQ(json[0]["left_out"][0]["why"], "does not vary in this drive");
  EXPECT_EQ(json[0]["left_out"][3]["why"], "a combination of other covariates in this drive");
}

// What is not known of the noise's model counts: fewer degrees of freedom than rows, fewest for what varies
// slowly.
TEST(StudyDynamics, DegreesOfFreedomAreThoseOfTheNoiseAtTheScalesOfTheCovariate) {
  Drive drive(7);
  double fast = 0.0;
  for (auto& row : drive.rows) row.omega_ddot_s_radps3[0] = fast = drive.normal(drive.generator);
  test::GivenRows rows(drive.rows);
  const auto result = study_dynamics(rows, options());
  const auto& gls = *result[0].gls;
  const auto* slow_covariate = find(result[0].gls, 0);
  const auto* fast_covariate = find(result[0].gls, 6);
  ASSERT_NE(slow_covariate, nullptr);
  ASSERT_NE(fast_covariate, nullptr);
  EXPECT_LT(slow_covariate->dof, 0.5 * static_cast<double>(gls.n));
  EXPECT_GT(slow_covariate->dof, 10.0);
  EXPECT_GT(fast_covariate->dof, slow_covariate->dof);
  EXPECT_LT(gls.dof_rest, static_cast<double>(gls.n));
  EXPECT_EQ(result[0].ols->dof_rest, static_cast<double>(result[0].ols->n - 16));
}

TEST(StudyDynamics, JsonHasTheFieldsOfTheInterface) {
  Drive drive(5);
  test::GivenRows rows(drive.rows);
  nlohmann::json json = nlohmann::json::array();
  append_regressions("mtx1", study_dynamics(rows, options()), json);
  ASSERT_EQ(json.size(), 4 * kErrorAxes);
  const auto& projected = json[3];
  EXPECT_EQ(projected["name"], "mtx1");
  EXPECT_EQ(projected["axis"], "gyro_x");
  EXPECT_EQ(projected["method"], "gls");
  EXPECT_EQ(projected["projected"], true);
  EXPECT_EQ(projected["f_dof"][0], 11);
  EXPECT_EQ(projected["coefficients"].size(), 11U);
  EXPECT_EQ(projected["left_out"].size(), 4U);
  EXPECT_EQ(projected["left_out"][0]["why"], "cannot be told from an error of the calibration");
  EXPECT_NE(projected["coefficients"][0]["means"].get<std::string>().find("delay"), std::string::npos);
}

/// No number of the regressions is anything but a number, so that their file can be read.
void expect_numbers(const std::array<AxisDynamics, kErrorAxes>& result) {
  nlohmann::json json = nlohmann::json::array();
  append_regressions("mtx1", result, json);
  EXPECT_EQ(json.dump().find("null"), std::string::npos) << json.dump(2);
}

TEST(StudyDynamics, AnImuWithoutAccelerometersIsStudiedAsFarAsItGoesAndTheRestSaysWhy) {
  Drive drive(8);
  for (auto& row : drive.rows) {
    row.accel_valid = false;
    row.e_accel_mps2 = {std::nan(""), std::nan(""), std::nan("")};
  }
  test::GivenRows rows(drive.rows);
  const auto result = study_dynamics(rows, options());
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    const auto& a = result[axis];
    const bool there = axis < 3;
    EXPECT_EQ(a.ols.has_value(), there);
    EXPECT_EQ(a.ols_projected.has_value(), there);
    EXPECT_EQ(a.gls.has_value(), there);
    EXPECT_EQ(a.gls_projected.has_value(), there);
    EXPECT_EQ(a.residual_noise.has_value(), there);
    EXPECT_EQ(a.no_gls_because.empty(), there) << a.no_gls_because;
  }
  expect_numbers(result);
}

TEST(StudyDynamics, ADriveTooShortForANoiseModelKeepsItsLeastSquaresAndSaysWhyThereIsNoMore) {
  const Drive drive(9, 30);
  test::GivenRows rows(drive.rows);
  auto demanding = options();
  demanding.noise_model = *noise::parse_model("WN+GM+GM+RW");
  const auto result = study_dynamics(rows, demanding);
  for (const auto& axis : result) {
    ASSERT_TRUE(axis.ols);
    EXPECT_EQ(axis.ols->n, 30U);
    EXPECT_FALSE(axis.gls);
    EXPECT_FALSE(axis.no_gls_because.empty());
  }
  expect_numbers(result);
}

TEST(StudyDynamics, WithoutAnyRowNothingIsSaidButWhy) {
  test::GivenRows rows({});
  for (const auto& axis : study_dynamics(rows, options())) {
    EXPECT_FALSE(axis.ols || axis.ols_projected || axis.gls || axis.gls_projected || axis.residual_noise);
    EXPECT_FALSE(axis.no_gls_because.empty());
  }
}

TEST(StudyDynamics, ARowThatComesTwiceCountsOnce) {
  const Drive drive(10);
  std::vector<ErrorRow> doubled;
  for (const auto& row : drive.rows) {
    doubled.push_back(row);
    if (row.counter % 3 == 0) doubled.push_back(row);
  }
  test::GivenRows once(drive.rows);
  test::GivenRows twice(doubled);
  const auto expected = study_dynamics(once, options());
  const auto result = study_dynamics(twice, options());
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    EXPECT_EQ(result[axis].ols->n, drive.rows.size());
    EXPECT_EQ(result[axis].gls->n, drive.rows.size());
    EXPECT_EQ(result[axis].ols->f, expected[axis].ols->f);
    EXPECT_EQ(result[axis].gls_projected->f, expected[axis].gls_projected->f);
  }
}

// A counter that jumps, as after a change of the device, must not be taken for samples that are missing one
// by one.
TEST(StudyDynamics, AHoleOfYearsCostsNoMoreThanOneAfterWhichNothingIsKnownOfTheNoise) {
  const Drive drive(11);
  const auto with_hole = [&](std::int64_t missing) {
    auto rows = drive.rows;
    for (std::size_t i = rows.size() / 2; i < rows.size(); ++i) rows[i].counter += missing;
    test::GivenRows source(rows);
    return study_dynamics(source, options());
  };
  const auto minutes = with_hole(60'000);
  const auto years = with_hole(std::int64_t{1} << 50U);
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    ASSERT_TRUE(years[axis].gls);
    EXPECT_EQ(years[axis].gls->n, drive.rows.size());
    EXPECT_EQ(years[axis].gls->f, minutes[axis].gls->f);
    EXPECT_EQ(years[axis].ols->f, minutes[axis].ols->f);
  }
}

TEST(StudyDynamics, AnErrorThatIsExplainedWholeOrNotThereGivesNumbersOrNothing) {
  Drive drive(12);
  for (auto& row : drive.rows) {
    row.e_gyro_radps = {0.0, 0.25 * row.predicted_f_s_mps2[0], 7.0};
    row.e_accel_mps2 = {};
  }
  test::GivenRows rows(drive.rows);
  const auto result = study_dynamics(rows, options());
  EXPECT_FALSE(result[0].ols) << "nothing is left to compare with";
  EXPECT_FALSE(result[0].gls);
  if (result[1].ols) {
    EXPECT_NEAR(find(result[1].ols, 9)->value, 0.25, 1e-9);
    EXPECT_GT(result[1].ols->r2, 1.0 - 1e-9);
  }
  expect_numbers(result);
}

}  // namespace
}  // namespace imuscope
