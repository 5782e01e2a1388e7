/// Everything that the study of dynamics returns, over a drive with gaps, faults and collinear columns: what is right
/// about it, the tests beside this one prove.

#include <gtest/gtest.h>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "given_rows.h"
#include "models/dynamics/column_wavelets.h"
#include "models/dynamics/covariates.h"
#include "models/dynamics/json.h"
#include "models/dynamics/noise_uncertainty.h"
#include "models/dynamics/physical_meaning.h"
#include "models/dynamics/regression.h"
#include "models/dynamics/study.h"
#include "models/noise/wavelet_variance.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using test::Answer;
using test::GivenRows;

ErrorRow distinct_row() {
  ErrorRow row{};
  row.predicted_omega_s_radps = {1.0, 2.0, -3.0};
  row.omega_dot_s_radps2 = {0.4, -0.5, 0.6};
  row.omega_ddot_s_radps3 = {7.0, 8.0, -9.0};
  row.predicted_f_s_mps2 = {1.1, -1.2, -9.3};
  row.f_dot_s_mps3 = {14.0, 15.0, 16.0};
  return row;
}

TEST(DynamicsAnswers, CovariatesColumnsAndMeanings) {
  Answer lines;
  const ErrorRow row = distinct_row();
  lines.line("covariates", covariates(row));
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    std::array<double, kAccelCalibrationColumns> columns{};
    columns.fill(99.0);
    calibration_columns(row, axis, columns);
    lines.line("calibration", axis, calibration_column_count(axis), columns);
    for (std::size_t k = 0; k < kCovariates; ++k)
      lines.line(covariate_name(k), covariate_unit(k), is_calibration_column(axis, k),
                 describe_coefficient(axis, k, -0.0123));
  }
  test::expect_recorded("models/dynamics/covariates.txt", lines.text());
}

void add_regression(Answer& lines, std::string_view name, const std::optional<Regression>& r) {
  if (!r) {
    lines.line(name, "none");
    return;
  }
  lines.line(name, r->n, r->r2, r->f, r->dof_model, r->dof_rest, r->p_value, r->residual_variance);
  for (const RegressionCoefficient& c : r->coefficients)
    lines.line(" ", c.covariate, c.value, c.sd, c.ci_low, c.ci_high, c.dof, c.p_value);
  for (const auto& [covariate, why] : r->left_out) lines.line(" left out", covariate, why);
}

/// Rows of one column of ones, one nuisance, five covariates (one constant, one a sum of two others) and the answer.
RegressionSums few_sums(int n) {
  RegressionSums sums(2, 5);
  for (int i = 0; i < n; ++i) {
    const double a = std::sin(0.3 * i);
    const double b = 4.0 + std::cos(1.7 * i);
    const double c = 0.01 * i;
    sums.add(
        std::array<double, 8>{1.0, a * b, a, 5.0, b, a - 2.0 * b, c,
                              3.0 + 0.5 * a * b - 1.5 * a + 0.2 * b + 0.1 * c + 0.4 * std::sin(11.0 * i)});
  }
  return sums;
}

TEST(DynamicsAnswers, Regression) {
  Answer lines;
  for (const int n : {0, 1, 7, 40, 255, 256, 257, 600}) {
    const RegressionSums sums = few_sums(n);
    lines.line("rows", n, sums.count());
    lines.line("coefficients", sums.all_coefficients());
    if (n < 7) continue;
    lines.line("covariances", sums.all_covariances());
    add_regression(lines, "at 0.95", sums.solve());
    add_regression(lines, "at 0.5", sums.solve(0.5));
  }
  RegressionSums without_answer(1, 2);
  for (int i = 0; i < 9; ++i) without_answer.add(std::array<double, 4>{1.0, 0.0, 7.0, 0.1 * i * i});
  add_regression(lines, "nothing varies", without_answer.solve());
  test::expect_recorded("models/dynamics/regression.txt", lines.text(), 1e-6, 1e-9);
}

TEST(DynamicsAnswers, ColumnWaveletsAndTheUncertaintyOfTheNoise) {
  Answer lines;
  ColumnWavelets wavelets(3);
  std::vector<double> errors;
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 1500; ++i) {
    errors.push_back(normal(random) + (i > 0 ? 0.9 * errors.back() : 0.0));
    const bool missing = i % 97 < 5 || (i > 700 && i < 760);
    if (missing) {
      wavelets.skip();
      continue;
    }
    wavelets.add(std::array<double, 3>{1.0, std::sin(0.02 * i) + 0.001 * i, std::cos(0.11 * i)});
  }
  const std::vector<ColumnLevel> levels = wavelets.levels();
  for (const ColumnLevel& level : levels) lines.line("level", level.level, level.products);

  const noise::WaveletVariance wv = noise::haar_wavelet_variance(errors).value();
  noise::FitResult fit;
  fit.model_error = 0.1;
  fit.model.components = {{noise::ProcessKind::kWhiteNoise, 1.3, {}},
                          {noise::ProcessKind::kRandomWalk, 0.02, {}}};
  const NoiseUncertainty noise(levels, fit, wv);
  Eigen::Matrix3d phi;
  phi << 2.0, 0.1, -0.2, 0.1, 0.5, 0.3, -0.2, 0.3, 1.4;
  for (const Eigen::Vector3d& a :
       {Eigen::Vector3d(1.0, 0.0, 0.0), Eigen::Vector3d(0.0, 1.0, 0.0), Eigen::Vector3d(0.3, -2.0, 1.0)})
    lines.line("relative variance", noise.relative_variance(phi, a));
  lines.line("of two columns",
             noise.of({2, 0}).relative_variance(Eigen::Matrix2d::Identity(), Eigen::Vector2d(1.0, 2.0)));
  test::expect_recorded("models/dynamics/uncertainty.txt", lines.text());
}

/// Motion in closed form, errors that depend on it, gaps, doubled rows and rows without one of the triads.
GivenRows winding_rows() {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<ErrorRow> rows;
  std::array<double, kErrorAxes> slow{};
  for (int i = 0; i < 3000; ++i) {
    const auto wave = [&](int k) { return std::sin((0.013 + 0.007 * k) * i + k) + 0.3 * normal(random); };
    ErrorRow row{};
    row.counter = 100 + i + (i > 2000 ? 700 : 0);
    for (int k = 0; k < 3; ++k) {
      const auto at = static_cast<std::size_t>(k);
      row.predicted_omega_s_radps[at] = wave(k);
      row.omega_dot_s_radps2[at] = 2.0 * wave(3 + k);
      row.omega_ddot_s_radps3[at] = 5.0 * wave(6 + k);
      row.predicted_f_s_mps2[at] = wave(9 + k) - (k == 2 ? 9.8 : 0.0);
      row.f_dot_s_mps3[at] = 3.0 * wave(12 + k);
    }
    for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
      slow[axis] = 0.97 * slow[axis] + 0.2 * normal(random);
      (axis < 3 ? row.e_gyro_radps[axis] : row.e_accel_mps2[axis - 3]) =
          0.1 * static_cast<double>(axis) + slow[axis] + 0.6 * normal(random) +
          0.08 * row.predicted_f_s_mps2[(axis + 1) % 3];
    }
    row.gyro_valid = i % 211 != 7;
    row.accel_valid = i < 1500 || i > 1530;
    if (i % 400 < 3) continue;
    rows.push_back(row);
    if (i % 500 == 250) rows.push_back(rows[rows.size() - 20]);
  }
  return GivenRows(std::move(rows));
}

TEST(DynamicsAnswers, WholeStudy) {
  GivenRows rows = winding_rows();
  const auto result = study_dynamics(rows, {50.0, *noise::parse_model("WN+GM"), 0.9});
  Answer ordinary;
  Answer generalised;
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    const AxisDynamics& a = result[axis];
    ordinary.line("axis", axis);
    add_regression(ordinary, "ols", a.ols);
    add_regression(ordinary, "ols projected", a.ols_projected);
    generalised.line("axis", axis, a.no_gls_because);
    add_regression(generalised, "gls", a.gls);
    add_regression(generalised, "gls projected", a.gls_projected);
    if (!a.residual_noise) continue;
    for (const noise::ParameterEstimate& p : a.residual_noise->parameters)
      generalised.line(p.process + " " + p.name + " " + p.unit, p.value);
  }
  test::expect_recorded("models/dynamics/ordinary.txt", ordinary.text(), 1e-6, 1e-9);
  // The noise's fit ends where a step no longer changes it.
  test::expect_recorded("models/dynamics/generalised.txt", generalised.text(), 1e-4, 1e-6);
}

TEST(DynamicsAnswers, JsonWithHolmsCorrection) {
  std::array<AxisDynamics, kErrorAxes> axes;
  for (std::size_t axis : {std::size_t{0}, std::size_t{4}}) {
    const double size = 1.0 + static_cast<double>(axis);
    Regression r;
    r.n = 100 + axis;
    r.r2 = 0.25;
    r.f = 3.5 * size;
    r.dof_model = 2;
    r.dof_rest = 97.5;
    r.p_value = 0.01 * size;
    r.residual_variance = 4.0;
    r.coefficients = {{1, 0.5 * size, 0.1, 0.3, 0.7, 90.0, 0.004 * size},
                      {9, -0.25, 0.2, -0.6, 0.1, 91.0, std::nan("")}};
    r.left_out = {{0, LeftOut::kConstant}, {3 + axis % 3, LeftOut::kCollinear}, {10, LeftOut::kCollinear}};
    axes[axis].ols = r;
    r.p_value = 0.03 * size;
    axes[axis].ols_projected = r;
    r.coefficients.pop_back();
    axes[axis].gls_projected = r;
    r.left_out.clear();
    axes[axis].gls = r;
  }
  nlohmann::json regressions = nlohmann::json::array();
  append_regressions("mtx1", axes, regressions);
  append_regressions("mtx2", axes, regressions);
  correct_for_number(regressions);
  test::expect_recorded("models/dynamics/regressions.json", regressions.dump(1) + "\n");
}

}  // namespace
}  // namespace imuscope
