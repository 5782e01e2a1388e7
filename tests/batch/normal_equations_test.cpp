#include "batch/normal_equations.h"

#include <gtest/gtest.h>
#include <random>

#include "navigation/so3.h"

namespace {

using namespace imuscope::batch;

/// Of all imperfections: products of two of them are left out of the derivatives.
constexpr double kSmall = 1e-3;

/// Spectra of drawn motion: what is tested is algebra, which must hold for any.
struct Drawn {
  Problem problem;
  Spectra study;
  Estimate estimate;

  Drawn() {
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    problem.plan.length = 256;
    problem.plan.starts = {0, 128};
    problem.plan.n_frequencies = 12;
    problem.plan.frequency_step_hz = 50.0 / 256.0;
    problem.bands = Bands(problem.plan.n_frequencies);
    problem.constant = window_spectrum(problem.plan);
    problem.from_middle_s = Eigen::Vector2d(-2.0, 3.0);
    problem.quietest_power.setConstant(problem.bands.size(), 2, 1e9);
    const auto draw = [&](Eigen::Index columns, double size) {
      Eigen::MatrixXd series(384, columns);
      for (Eigen::Index i = 0; i < series.size(); ++i) series.data()[i] = size * normal(random);
      return series;
    };
    problem.reference = Spectra(problem.plan, draw(kReferenceColumns, 1.0));
    study = Spectra(problem.plan, draw(6, 1.0));
    for (Eigen::Index i = 3; i < kParameters; ++i) estimate.sensor.x[i] = kSmall * normal(random);
    estimate.sensor.C_b_s = imuscope::exp_so3(Eigen::Vector3d(0.4, -1.1, 2.0));
    estimate.deviation.assign(static_cast<std::size_t>(problem.bands.size()), DeviationVector::Zero());
    estimate.deviation_sd.setConstant(problem.bands.size(), 2, 1e-9);
  }

  [[nodiscard]] NoiseBands noise() const {
    return {problem.bands, 2, problem.plan.n_frequencies, residuals(problem, study, estimate)};
  }

  /// Weighted sum of squares; the noise stays what it was.
  [[nodiscard]] double cost(const Estimate& at, const NoiseBands& noise) const {
    const Residuals e = residuals(problem, study, at);
    double sum = 0.0;
    for (Eigen::Index band = 0; band < problem.bands.size(); ++band)
      for (Eigen::Index w = 0; w < 2; ++w)
        for (Eigen::Index k = problem.bands.first(band); k < problem.bands.end(band); ++k)
          for (Eigen::Index i = 0; i < 6; ++i)
            sum += (k == 0 ? 1.0 : 2.0) * std::norm(e(w * problem.plan.n_frequencies + k, i)) /
                   noise.window_power(w, band, i);
    return sum;
  }
};

/// The time offset and the clock's rate act on the samples before the transform, so that no difference of
/// residuals shows them; every other derivative is held against one.
TEST(NormalEquations, GradientIsThatOfTheSumOfSquares) {
  Drawn drawn;
  const NoiseBands noise = drawn.noise();
  // Hardly any noise is the reference's: the weights then do not depend on the parameters.
  const auto equations =
      normal_equations(drawn.problem, drawn.study, residuals(drawn.problem, drawn.study, drawn.estimate),
                       drawn.estimate, noise, 1e-12, false);
  for (Eigen::Index i = 0; i < kParameters; ++i) {
    if (i == kTimeOffset || i == kClockRate) continue;
    constexpr double kStep = 1e-6;
    ParameterVector step = ParameterVector::Zero();
    step[i] = kStep;
    Estimate more = drawn.estimate;
    more.sensor.add(step);
    Estimate less = drawn.estimate;
    less.sensor.add(-step);
    const double difference = -0.25 * (drawn.cost(more, noise) - drawn.cost(less, noise)) / kStep;
    const double scale = std::sqrt(equations.information(i, i) * drawn.cost(drawn.estimate, noise));
    EXPECT_NEAR(equations.gradient[i], difference, 10.0 * kSmall * scale) << "parameter " << i;
  }
}

TEST(NormalEquations, ABandThatMayDeviateFreelyTellsNothingOfTheAxes) {
  Drawn drawn;
  const NoiseBands noise = drawn.noise();
  const Residuals e = residuals(drawn.problem, drawn.study, drawn.estimate);
  const auto rigid = normal_equations(drawn.problem, drawn.study, e, drawn.estimate, noise, 0.5, false);
  drawn.estimate.deviation_sd.setConstant(1e3);
  const auto loose = normal_equations(drawn.problem, drawn.study, e, drawn.estimate, noise, 0.5, false);
  // What is left is what zero frequency says.
  for (const Eigen::Index i : {Eigen::Index{kPsi}, Eigen::Index{kGyroShape}, Eigen::Index{kAlpha}})
    EXPECT_LT(loose.information(i, i), 0.5 * rigid.information(i, i)) << i;
}

TEST(NormalEquations, NoiseOfTheReferenceIsNoInformation) {
  Drawn drawn;
  const NoiseBands noise = drawn.noise();
  const Residuals e = residuals(drawn.problem, drawn.study, drawn.estimate);
  const auto equations = normal_equations(drawn.problem, drawn.study, e, drawn.estimate, noise, 0.5, true);
  EXPECT_GT(equations.of_noise(kLeverArm, kLeverArm), 0.0);
  EXPECT_LT(equations.of_noise(kLeverArm, kLeverArm), equations.information(kLeverArm, kLeverArm));
  const auto without = normal_equations(drawn.problem, drawn.study, e, drawn.estimate, noise, 1e-12, true);
  EXPECT_LT(without.of_noise(kLeverArm, kLeverArm), 1e-9 * without.information(kLeverArm, kLeverArm));
}

}  // namespace
