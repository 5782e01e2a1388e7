#include "estimation/batch/normal_equations.h"

#include <gtest/gtest.h>
#include <cmath>
#include <complex>
#include <random>

#include "estimation/navigation/so3.h"

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
    problem.gyro_moment.assign(static_cast<std::size_t>(problem.bands.size()),
                               1e9 * Eigen::Matrix3d::Identity());
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
    return {problem.bands, 2, problem.plan.n_frequencies, residuals(problem, study, estimate),
            Eigen::MatrixX2d::Zero(problem.bands.size(), 2)};
  }

  [[nodiscard]] NormalEquations equations(const NoiseBands& noise, double reference_share,
                                          bool corrected) const {
    return normal_equations(band_sums(problem, study, residuals(problem, study, estimate), estimate, noise,
                                      ReferenceNoise::even(problem.bands, reference_share), corrected),
                            estimate);
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
  const auto equations = drawn.equations(noise, 1e-12, false);
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

/// Two minutes at 50 Hz.
constexpr Eigen::Index kRecordInstants = 6'000;

Eigen::MatrixXd white(std::mt19937_64& random, Eigen::Index columns) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(kRecordInstants, columns, [&] { return normal(random); });
}

/// A vehicle's motion is slow: each instant keeps so much of the one before.
Eigen::MatrixXd slow(std::mt19937_64& random, Eigen::Index columns, double kept) {
  Eigen::MatrixXd series = white(random, columns);
  for (Eigen::Index i = 1; i < kRecordInstants; ++i) series.row(i) += kept * series.row(i - 1);
  return series;
}

/// Of a record without gaps, up to 8 Hz.
Problem problem_of(const Eigen::MatrixXd& reference) {
  Problem problem;
  problem.plan = plan_windows(std::vector<char>(kRecordInstants, 1), 50.0, 8.0);
  problem.bands = Bands(problem.plan.n_frequencies);
  problem.constant = window_spectrum(problem.plan);
  problem.reference = Spectra(problem.plan, reference);
  problem.from_middle_s.setLinSpaced(static_cast<Eigen::Index>(problem.plan.starts.size()), -1.0, 1.0);
  problem.gyro_moment.assign(static_cast<std::size_t>(problem.bands.size()),
                             1e9 * Eigen::Matrix3d::Identity());
  return problem;
}

/// A sensor like the reference, on a body that is rigid in every band.
Estimate rigid_estimate(const Problem& problem) {
  Estimate estimate;
  estimate.deviation.assign(static_cast<std::size_t>(problem.bands.size()), DeviationVector::Zero());
  estimate.deviation_sd.setConstant(problem.bands.size(), 2, 1e-9);
  return estimate;
}

/// Windows overlap, and neighbouring frequencies of a window are correlated; all of it has to come out as if
/// every instant had been counted once.
TEST(NormalEquations, ScoresOfWhiteNoiseVaryAsTheInformationSays) {
  std::mt19937_64 random(5);
  constexpr double kKept = 0.99;
  const Problem problem = problem_of(slow(random, kReferenceColumns, kKept));
  const auto n_windows = static_cast<Eigen::Index>(problem.plan.starts.size());
  Estimate estimate = rigid_estimate(problem);
  // Without a lever arm nothing would tell a delay of the reference's accelerometers.
  estimate.sensor.x.segment<3>(kLeverArm).setConstant(0.3);
  const Eigen::MatrixX2d none = Eigen::MatrixX2d::Zero(problem.bands.size(), 2);
  ParameterVector sum = ParameterVector::Zero();
  constexpr int kDraws = 30;
  for (int draw = 0; draw < kDraws; ++draw) {
    // What the S-IMU shows only enters through its g-sensitivity.
    const Spectra study(problem.plan, slow(random, 6, kKept));
    Residuals noise(n_windows * problem.plan.n_frequencies, 6);
    const Spectra drawn(problem.plan, white(random, 6));
    for (Eigen::Index w = 0; w < n_windows; ++w)
      for (Eigen::Index k = 0; k < problem.plan.n_frequencies; ++k)
        noise.row(w * problem.plan.n_frequencies + k) = drawn.row(w, k);
    const NoiseBands bands(problem.bands, n_windows, problem.plan.n_frequencies, noise, none);
    const auto equations = normal_equations(
        band_sums(problem, study, noise, estimate, bands, ReferenceNoise::even(problem.bands, 0.0), false),
        estimate);
    sum += equations.gradient.cwiseAbs2().cwiseQuotient(equations.information.diagonal());
  }
  const ParameterVector ratio = sum / kDraws;
  // The ends of the record lie in one window instead of two and count half, so that a little less than one is
  // right: twelve windows have two ends.
  EXPECT_LT(ratio.mean(), 1.05);
  EXPECT_GT(ratio.mean(), 0.7);
}

TEST(NormalEquations, ABandThatMayDeviateFreelyTellsNothingOfTheAxes) {
  Drawn drawn;
  const NoiseBands noise = drawn.noise();
  const auto rigid = drawn.equations(noise, 0.0, false);
  drawn.estimate.deviation_sd.setConstant(1e3);
  const auto loose = drawn.equations(noise, 0.0, false);
  // What is left is what zero frequency says, which has no deviation.
  const auto at_zero =
      band_sums(drawn.problem, drawn.study, residuals(drawn.problem, drawn.study, drawn.estimate),
                drawn.estimate, noise, ReferenceNoise::even(drawn.problem.bands, 0.0), false)
          .front();
  for (const Eigen::Index i : {Eigen::Index{kPsi}, Eigen::Index{kGyroShape}, Eigen::Index{kAlpha}}) {
    EXPECT_GT(rigid.information(i, i), 1.2 * at_zero.information(i, i)) << i;
    EXPECT_NEAR(loose.information(i, i), at_zero.information(i, i), 1e-3 * rigid.information(i, i)) << i;
  }
}

TEST(NormalEquations, NoiseOfTheReferenceIsNoInformation) {
  Drawn drawn;
  const NoiseBands noise = drawn.noise();
  const auto equations = drawn.equations(noise, 0.5, true);
  EXPECT_GT(equations.of_noise(kLeverArm, kLeverArm), 0.0);
  EXPECT_LT(equations.of_noise(kLeverArm, kLeverArm), equations.information(kLeverArm, kLeverArm));
  const auto without = drawn.equations(noise, 1e-12, true);
  EXPECT_LT(without.of_noise(kLeverArm, kLeverArm), 1e-9 * without.information(kLeverArm, kLeverArm));
}

/// Two IMUs as noisy as each other on one slow motion, which neither shows as it is.
struct NoisyPair {
  Problem problem;
  Spectra study;
  Spectra true_motion;
  Estimate estimate;
  NoiseBands noise;

  NoisyPair() {
    std::mt19937_64 random(3);
    const Eigen::MatrixXd motion = slow(random, kReferenceColumns, 0.9);
    Eigen::MatrixXd seen = motion;
    seen.leftCols<6>() += white(random, 6);
    problem = problem_of(seen);
    true_motion = Spectra(problem.plan, motion);
    study = Spectra(problem.plan, (motion.leftCols<6>() + white(random, 6)).eval());
    estimate = rigid_estimate(problem);
    noise = NoiseBands(problem.bands, problem.from_middle_s.size(), problem.plan.n_frequencies, residual(),
                       Eigen::MatrixX2d::Zero(problem.bands.size(), 2));
  }

  [[nodiscard]] Residuals residual() const { return residuals(problem, study, estimate); }
  /// As if the S-IMU's readings were so much later, or its clock so much faster.
  [[nodiscard]] Residuals residual_with(Eigen::Index parameter, double step) const {
    Residuals e = residual();
    for (Eigen::Index w = 0; w < problem.from_middle_s.size(); ++w) {
      const double by_s = parameter == kTimeOffset ? step : step * problem.from_middle_s[w];
      for (Eigen::Index k = 0; k < problem.plan.n_frequencies; ++k) {
        const std::complex<double> turn = std::exp(-by_s * derivative(problem.plan.frequency_hz(k)));
        e.row(w * problem.plan.n_frequencies + k) += (turn - 1.0) * study.row(w, k);
      }
    }
    return e;
  }
  [[nodiscard]] std::vector<BandSums> sums(const Residuals& e, const ReferenceNoise& reference) const {
    return band_sums(problem, study, e, estimate, noise, reference, true);
  }
  [[nodiscard]] ParameterVector known(const ReferenceNoise& reference, bool as_it_shows) const {
    auto all = sums(residual(), reference);
    if (as_it_shows) show_noise(problem, study, residual(), estimate, noise, reference, all);
    const auto equations = normal_equations(all, estimate);
    return (equations.information - equations.of_noise).diagonal();
  }
  /// What the motion itself would tell.
  [[nodiscard]] ParameterVector told_by_true_motion() const {
    Problem of_truth = problem;
    of_truth.reference = true_motion;
    const auto none = ReferenceNoise::even(problem.bands, 0.0);
    return normal_equations(band_sums(of_truth, study, residual(), estimate, noise, none, false), estimate)
        .information.diagonal();
  }
};

/// B-13a against the gradient itself: how it changes when the S-IMU's readings are moved in time.
TEST(NormalEquations, WhatBothImusKnowOfTimeIsTheSlopeOfTheGradient) {
  const NoisyPair pair;
  for (const double share : {0.2, 0.5, 0.7}) {
    const auto reference = ReferenceNoise::even(pair.problem.bands, share);
    const ParameterVector known = pair.known(reference, true);
    for (const Eigen::Index i : {Eigen::Index{kTimeOffset}, Eigen::Index{kClockRate}}) {
      constexpr double kStep = 1e-5;
      const auto gradient = [&](double step) {
        return normal_equations(pair.sums(pair.residual_with(i, step), reference), pair.estimate).gradient[i];
      };
      const double slope = -(gradient(kStep) - gradient(-kStep)) / (2.0 * kStep);
      EXPECT_NEAR(known[i] / slope, 1.0, 1e-4) << "parameter " << i << ", share " << share;
    }
  }
}

/// B-13a against the motion that neither IMU shows, whatever is believed of their noise.
TEST(NormalEquations, WhatBothImusKnowIsWhatTheMotionTells) {
  const NoisyPair pair;
  const ParameterVector truth = pair.told_by_true_motion();
  constexpr double kWrong = 0.2;  // of the noise half is the reference's
  for (const double share : {kWrong, 0.5, 0.7}) {
    const ParameterVector known = pair.known(ReferenceNoise::even(pair.problem.bands, share), true);
    for (const Eigen::Index i : {Eigen::Index{kPsi}, Eigen::Index{kTimeOffset}, Eigen::Index{kClockRate},
                                 Eigen::Index{kGyroShape}, Eigen::Index{kAlpha}, Eigen::Index{kAccelDelay}})
      EXPECT_NEAR(known[i] / truth[i], 1.0, 0.03) << "parameter " << i << ", share " << share;
  }
  const ParameterVector supposed = pair.known(ReferenceNoise::even(pair.problem.bands, kWrong), false);
  EXPECT_GT(supposed[kTimeOffset], 1.05 * truth[kTimeOffset]);
}

/// B-24: the published frame describes the same sensor, and its derivative is that of the parameters.
TEST(AxesFrame, IsTheSameSensorWithTriangularMatrices) {
  const SensorState symmetric = Drawn().estimate.sensor;
  const SensorState axes = in_axes_frame(symmetric).sensor;
  EXPECT_LT((axes.C_b_gyro() - symmetric.C_b_gyro()).norm(), 1e-14);
  EXPECT_LT((axes.C_b_accel() - symmetric.C_b_accel()).norm(), 1e-14);
  for (const auto& matrix : {axes.gyro_shape(), axes.accel_shape()})
    for (const auto& [row, column] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)})
      EXPECT_EQ(matrix(row, column), 0.0);

  const auto derivative = in_axes_frame(symmetric).derivative;
  constexpr double kStep = 1e-5;
  for (Eigen::Index i = kGyroShape; i < kAccelDelay; ++i) {
    SensorState moved = symmetric;
    ParameterVector step = ParameterVector::Zero();
    step[i] = kStep;
    moved.add(step);
    const SensorState there = in_axes_frame(moved).sensor;
    ParameterVector change = (there.x - axes.x) / kStep;
    change.segment<3>(kPsi) = -imuscope::log_so3(axes.C_b_s.transpose() * there.C_b_s) / kStep;
    // Departures are of the size kSmall, and products of two of them are left out.
    EXPECT_LT((change - derivative.col(i)).cwiseAbs().maxCoeff(), 10.0 * kSmall) << i;
  }
}

}  // namespace
