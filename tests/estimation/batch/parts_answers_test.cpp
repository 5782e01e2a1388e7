/// Everything that the parts of the batch estimate return, over rich inputs: what is right about it, the tests beside
/// this one prove against closed forms and differences.

#include <gtest/gtest.h>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "estimation/batch/checks.h"
#include "estimation/batch/grid.h"
#include "estimation/batch/normal_equations.h"
#include "estimation/batch/pair_moments.h"
#include "estimation/batch/prior_scales.h"
#include "estimation/batch/stability.h"
#include "estimation/navigation/so3.h"
#include "synthetic_pair.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace {

using namespace imuscope::batch;
using imuscope::test::Answer;
using imuscope::test::expect_recorded;

/// Numbers that are all unlike, between -1 and 1.
double unlike(Eigen::Index i) { return std::sin(12.9898 * static_cast<double>(i + 1)); }

SensorState crooked_state() {
  SensorState state;
  state.C_b_s = imuscope::exp_so3({0.4, -1.1, 2.0});
  for (Eigen::Index i = kLeverArm; i < kParameters; ++i) state.x[i] = 0.02 * unlike(i);
  return state;
}

void add_state(Answer& lines, std::string_view name, const SensorState& state) {
  lines.line(name, state.above, state.C_b_s);
  lines.line(" gyro shape", state.gyro_shape());
  lines.line(" accel shape", state.accel_shape());
  lines.line(" b to gyro", state.C_b_gyro());
  lines.line(" b to accel", state.C_b_accel());
  lines.line(" g sensitivity", state.g_sensitivity());
  lines.line(" flexure", state.flexure());
  lines.line(" accel flexure", state.accel_flexure());
  lines.line(" compliance", state.compliance());
  for (Eigen::Index axis = 0; axis < 3; ++axis) lines.line(" place", state.place_s_m(axis));
  lines.line(" offset", state.time_offset_s(7.0), state.lever_arm_b_m());
}

TEST(BatchPartsAnswers, SensorModel) {
  Answer lines;
  SensorState state = crooked_state();
  add_state(lines, "symmetric", state);
  const AxesFrame axes = in_axes_frame(state);
  add_state(lines, "axes", axes.sensor);
  lines.line("parameters", axes.sensor.x);
  lines.line("derivative", Eigen::MatrixXd(axes.derivative.topRows<3>().middleCols<15>(kGyroShape)));
  lines.line("derivative", Eigen::MatrixXd(axes.derivative.middleRows<3>(kAlpha).middleCols<15>(kGyroShape)));
  lines.line("derivative", axes.derivative.diagonal(), axes.derivative.sum());
  ParameterVector correction;
  for (Eigen::Index i = 0; i < kParameters; ++i) correction[i] = 0.01 * unlike(3 * i);
  state.add(correction);
  add_state(lines, "corrected", state);
  lines.line("parameters", state.x);
  for (const double above : {0.0, 0.5})
    for (Eigen::Index j = 0; j < 6; ++j) lines.line("shape", j, above, shape_derivative(j, above));

  SensorClass sensor;
  lines.line("prior", prior_sd(sensor));
  const double per_root_hour = std::numbers::pi / 180.0 / 60.0;
  for (const double white : {1e-9, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 30.0}) {
    sensor.reference = imuscope::reference_grade(white * per_root_hour);
    lines.line("reference", white, 1e3 * sensor.reference.scale_sd, 1e3 * sensor.reference.lean_sd_rad,
               1e3 * sensor.reference.triad_sd_rad);
  }
  expect_recorded("estimation/batch/sensor_model.txt", lines.text(), 1e-6, 1e-10);
}

/// Series of drawn motion: what is held is algebra.
struct DrawnProblem {
  Problem problem;
  Spectra study;
  Estimate estimate;

  DrawnProblem() {
    std::mt19937_64 random(17);
    std::normal_distribution<double> normal;
    problem.plan.length = 256;
    problem.plan.starts = {0, 128, 256};
    problem.plan.n_frequencies = 14;
    problem.plan.frequency_step_hz = 50.0 / 256.0;
    problem.bands = Bands(problem.plan.n_frequencies);
    problem.constant = window_spectrum(problem.plan);
    problem.from_middle_s = Eigen::Vector3d(-2.0, 0.5, 3.0);
    problem.gyro_moment.assign(static_cast<std::size_t>(problem.bands.size()),
                               4.0 * Eigen::Matrix3d::Identity());
    const auto draw = [&](Eigen::Index columns) {
      Eigen::MatrixXd series(512, columns);
      for (double& value : series.reshaped()) value = normal(random);
      for (Eigen::Index i = 1; i < 512; ++i) series.row(i) += 0.8 * series.row(i - 1);
      return series;
    };
    const Eigen::MatrixXd reference = draw(kReferenceColumns);
    problem.reference = Spectra(problem.plan, reference);
    study = Spectra(problem.plan, Eigen::MatrixXd(draw(6) + reference.leftCols<6>()));
    estimate.sensor = crooked_state();
    for (Eigen::Index band = 0; band < problem.bands.size(); ++band)
      estimate.deviation.push_back(
          DeviationVector::NullaryExpr([&](Eigen::Index i) { return 0.01 * unlike(7 * band + i); }));
    estimate.deviation_sd.setConstant(problem.bands.size(), 2, 0.02);
    estimate.deviation_sd.col(1).setConstant(0.05);
  }
};

TEST(BatchPartsAnswers, Transfer) {
  Answer lines;
  const DrawnProblem drawn;
  const Transfer t(drawn.estimate.sensor, drawn.estimate.deviation[3]);
  lines.line("rotated", t.C_accel_rotated, t.compliance_b, t.delay_s);
  for (const Eigen::Index k : {Eigen::Index{0}, Eigen::Index{2}, Eigen::Index{13}}) {
    const double hz = drawn.problem.plan.frequency_hz(k);
    const Motion motion = motion_of(drawn.problem.reference, 1, k);
    lines.line("arm", motion.arm.real(), motion.arm.imag());
    lines.line("force products", motion.force_products.real());
    lines.line("force at", motion.force_at({0.3, -0.2, 0.7}).real());
    const Vector3c felt = accelerometers(t, motion);
    lines.line("felt", felt.real(), felt.imag());
    const Vector3c turned = gyros(t, motion, hz);
    lines.line("turned", turned.real(), turned.imag());
    const Vector6c all =
        predicted(t, motion, Vector3c(1.0, std::complex<double>(0.0, 2.0), 3.0), {0.4, 0.1}, hz);
    lines.line("predicted", all.real(), all.imag());
    lines.line("gain", flexure_gain(hz), derivative(hz).real(), derivative(hz).imag());
  }
  expect_recorded("estimation/batch/transfer.txt", lines.text());
}

TEST(BatchPartsAnswers, WindowsBandsAndNoise) {
  Answer lines;
  const auto plan = [&](std::size_t n, std::vector<std::size_t> holes) {
    std::vector<char> valid(n, 1);
    for (const std::size_t hole : holes) valid[hole] = 0;
    const WindowPlan p = plan_windows(valid, 50.0, 8.0);
    lines.line("plan", n, holes, p.length, p.n_frequencies, p.frequency_step_hz, p.frequency_hz(3));
    lines.line(" starts", p.starts);
  };
  // Thirteen half windows of 512 instants make twelve windows.
  plan(13 * 512 - 1, {});
  plan(13 * 512, {});
  plan(13 * 256 - 1, {});
  plan(13 * 256, {});
  plan(1000, {500});
  plan(1000, {0, 257, 258, 999});
  plan(256, {});
  plan(255, {});
  plan(0, {});
  for (const Eigen::Index n : {1, 3, 4, 5, 6, 20, 164}) {
    const Bands bands(n);
    std::vector<Eigen::Index> edges;
    for (Eigen::Index band = 0; band < bands.size(); ++band) edges.push_back(bands.first(band));
    lines.line("bands", n, bands.size(), edges, bands.end(bands.size() - 1), bands.width(bands.size() - 1));
  }
  const DrawnProblem drawn;
  lines.line("window", drawn.problem.constant.real(), drawn.problem.constant.imag());
  lines.line("spectrum", drawn.problem.reference.row(2, 5).real(), drawn.problem.reference.row(2, 5).imag());
  Residuals e = residuals(drawn.problem, drawn.study, drawn.estimate);
  e.middleRows(28, 14) *= 3.0;  // one window is louder
  lines.line("residuals", Eigen::MatrixXd(e.real()));
  e.col(4).segment(0, 14) *= 1e-12;
  Eigen::MatrixX2d taken(drawn.problem.bands.size(), 2);
  for (Eigen::Index band = 0; band < taken.rows(); ++band)
    taken.row(band) << 0.4 * static_cast<double>(band), 9.0;
  const NoiseBands noise(drawn.problem.bands, 3, drawn.problem.plan.n_frequencies, e, taken);
  for (Eigen::Index band = 0; band < drawn.problem.bands.size(); ++band) {
    lines.line("noise", noise.windows(), noise.claimed(band), noise.power(band), noise.power(band, 4));
    for (Eigen::Index w = 0; w < 3; ++w)
      lines.line(" window", noise.window_power(w, band), noise.window_power(w, band, 2));
  }
  Residuals silent = e;
  silent.col(1).setZero();
  const NoiseBands quiet(drawn.problem.bands, 3, drawn.problem.plan.n_frequencies, silent, taken);
  lines.line("silent", 1e30 * quiet.power(2, 1), 1e30 * quiet.window_power(1, 2, 1));
  expect_recorded("estimation/batch/windows_and_noise.txt", lines.text());
}

/// A matrix through one vector of unlike numbers: every element counts.
Eigen::VectorXd through_unlike(const Eigen::MatrixXd& matrix) {
  return matrix * Eigen::VectorXd::NullaryExpr(matrix.cols(), [](Eigen::Index i) { return unlike(i); });
}

TEST(BatchPartsAnswers, NormalEquations) {
  Answer lines;
  const DrawnProblem drawn;
  const Residuals e = residuals(drawn.problem, drawn.study, drawn.estimate);
  const NoiseBands noise(drawn.problem.bands, 3, drawn.problem.plan.n_frequencies, e,
                         Eigen::MatrixX2d::Zero(drawn.problem.bands.size(), 2));
  for (const bool corrected : {false, true}) {
    const auto sums = band_sums(drawn.problem, drawn.study, e, drawn.estimate, noise,
                                ReferenceNoise::even(drawn.problem.bands, 0.3), corrected);
    for (const std::size_t band : {std::size_t{0}, std::size_t{4}}) {
      lines.line("band", corrected, band);
      lines.line(" information", through_unlike(sums[band].information));
      lines.line(" of gyros", through_unlike(sums[band].of_gyros));
      lines.line(" of noise", through_unlike(sums[band].of_noise));
      lines.line(" scores", sums[band].scores.rows(), through_unlike(sums[band].scores.transpose()));
    }
    const NormalEquations equations = normal_equations(sums, drawn.estimate);
    lines.line("information", through_unlike(equations.information));
    lines.line("of noise", through_unlike(equations.of_noise));
    lines.line("gradient", equations.gradient);
    lines.line("scores", through_unlike(equations.window_scores.transpose()));
    lines.line("reference's axes",
               through_unlike(reference_slopes(drawn.problem, drawn.study, e, drawn.estimate, noise,
                                               ReferenceNoise::even(drawn.problem.bands, 0.3),
                                               imuscope::kNavigationGrade, equations)
                                  .transpose()));
    Eigen::Matrix<double, kParameters, kParameters> covariance = equations.information;
    covariance.diagonal().array() += 1.0;
    covariance = covariance.inverse().eval();
    for (std::size_t band = 0; band < sums.size(); ++band) {
      const auto& own = equations.bands[band];
      lines.line("elimination", band, own.own);
      lines.line(" coupling", through_unlike(own.coupling));
      lines.line(" covariance", through_unlike(own.covariance));
      lines.line(" taken", numbers_taken(sums[band], own, covariance));
    }
  }
  expect_recorded("estimation/batch/normal_equations.txt", lines.text(), 1e-5, 1e-9);
}

TEST(BatchPartsAnswers, ReferenceNoise) {
  Answer lines;
  const DrawnProblem drawn;
  Estimate rigid = drawn.estimate;
  for (DeviationVector& deviation : rigid.deviation) deviation.setZero();
  Residuals e = residuals(drawn.problem, drawn.study, rigid);
  e.middleRows(14, 14) *= 0.4;
  const NoiseBands noise(drawn.problem.bands, 3, drawn.problem.plan.n_frequencies, e,
                         Eigen::MatrixX2d::Zero(drawn.problem.bands.size(), 2));
  const ReferenceNoise found(drawn.problem.plan, drawn.problem.bands, drawn.problem.reference, e,
                             rigid.sensor, noise);
  for (const auto& [name, one] : {std::pair{"found", found}, std::pair{"more of gyros", found.shifted(0)},
                                  std::pair{"more of accelerometers", found.shifted(1)},
                                  std::pair{"even", ReferenceNoise::even(drawn.problem.bands, 0.4)}}) {
    lines.line(name);
    for (Eigen::Index band = 0; band < drawn.problem.bands.size(); ++band) {
      lines.line(" share", one.mean_share(noise, band));
      for (Eigen::Index w = 0; w < 3; ++w) lines.line("  power", one.power(noise, w, band));
    }
  }
  expect_recorded("estimation/batch/reference_noise.txt", lines.text());
}

TEST(BatchPartsAnswers, PriorScales) {
  Answer lines;
  using Covariance = PriorScales::Covariance;
  const Covariance root =
      Covariance::NullaryExpr([](Eigen::Index i, Eigen::Index j) { return unlike(i * kParameters + j); });
  PriorScales scales{SensorClass{}};
  lines.line("class", scales.precision());
  ParameterVector x;
  for (Eigen::Index i = 0; i < kParameters; ++i) x[i] = 0.004 * unlike(i);
  const Covariance small = 1e-8 * root * root.transpose();
  scales.learn_sizes(x, small);
  lines.line("learned", scales.precision());
  // Places of nothing, known to a tenth of a millimetre: one chip; of centimetres: three; and back, twice.
  for (const double size : {0.0, 0.0, 1.0, 0.0, 1.0, 0.0}) {
    x.segment<6>(kPlaces).setConstant(0.01 * size);
    scales.choose_places(x, small);
    lines.line("places", size, scales.one_chip(), scales.precision()[kPlaces]);
    x.segment<6>(kPlaces) = 1e-4 * x.segment<6>(kGyroShape) / 0.004;
    const Covariance doubt = scales.doubt(x, 0.3 * small);
    lines.line(" doubt", 1e12 * through_unlike(doubt));
  }
  expect_recorded("estimation/batch/prior_scales.txt", lines.text(), 1e-5, 1e-9);
}

TEST(BatchPartsAnswers, LargestChange) {
  Answer lines;
  for (const Eigen::Index n : {9, 10, 30}) {
    for (const double jump : {0.0, 1.0, 6.0}) {
      WindowInfluences influences(n, kWatched);
      for (Eigen::Index w = 0; w < n; ++w)
        for (Eigen::Index i = 0; i < kWatched; ++i)
          influences(w, i) = unlike(w * kWatched + i) + (i == 3 ? (w < n / 3 ? jump : -0.5 * jump) : 0.0);
      WatchedVector variance;
      for (Eigen::Index i = 0; i < kWatched; ++i) variance[i] = 10.0 + static_cast<double>(i);
      const Change change = largest_change(influences, variance);
      lines.line("change", n, jump, change.window, change.statistic, change.is_told(), change.difference,
                 change.reach);
      lines.line(" variance of sum", Eigen::MatrixXd(variance_of_sum(influences, 3)));
    }
  }
  expect_recorded("estimation/batch/largest_change.txt", lines.text());
}

/// Sines in all six axes, with jitter, lost samples and two gaps.
ImuRecord wavy_record() {
  ImuRecord record;
  for (int i = 0; i < 800; ++i) {
    const bool lost = i == 200 || i == 260 || i == 261 || (i >= 400 && i < 403) || (i > 500 && i < 520) ||
                      i == 1 || i == 798;
    if (lost) continue;
    const double t = 0.01 * i + 0.0011 * std::sin(1.7 * i);
    const auto wave = [&](double hz) { return static_cast<float>(std::sin(6.2831853 * hz * t + hz)); };
    record.add(t, {wave(1.0), wave(2.3), wave(4.1)}, {wave(0.7), wave(9.0), -9.81F + wave(3.0)});
  }
  return record;
}

TEST(BatchPartsAnswers, Grid) {
  Answer lines;
  const ImuRecord record = wavy_record();
  lines.line("period", sample_period_s(record));
  std::vector<double> instants;
  for (int i = 0; i < 400; ++i) instants.push_back(0.02 * i);
  const Grid grid = make_grid(record, instants, true);
  std::string valid;
  for (const char one : grid.valid) valid += one != 0 ? '1' : '0';
  lines.line("valid", valid);
  for (Eigen::Index i = 0; i < 400; i += 6) lines.line("at", i, grid.motion.row(i), grid.omega_dot.row(i));
  const Grid without = make_grid(record, instants, false);
  lines.line("without derivative", without.omega_dot.rows(), (without.motion - grid.motion).norm());
  expect_recorded("estimation/batch/grid.txt", lines.text(), 1e-6, 1e-9);
}

TEST(BatchPartsAnswers, PairMoments) {
  Answer lines;
  std::vector<double> instants;
  for (int i = 0; i < 300; ++i) instants.push_back(0.3 + 0.02 * i);
  const Grid reference = make_grid(wavy_record(), instants, false);
  ImuRecord turned = wavy_record();
  const Eigen::Matrix3f C = imuscope::exp_so3({0.3, -0.8, 1.2}).cast<float>();
  for (std::size_t i = 0; i < turned.size(); ++i) {
    turned.omega_radps[i] = (1.1F * C * turned.omega_radps[i]).eval() + Eigen::Vector3f(0.01F, 0.02F, 0.03F);
    turned.f_mps2[i] =
        (C * turned.f_mps2[i] + 0.4F * Eigen::Vector3f(turned.omega_radps[i].y(), 0.0F, 1.0F)).eval();
  }
  const PairMoments moments(reference, make_grid(turned, instants, false));
  for (const auto& [name, m] : {std::pair{"rates", moments.rates}, std::pair{"forces", moments.forces},
                                std::pair{"with gravity", moments.forces_with_gravity}}) {
    lines.line(name, m.study_reference, m.study);
    lines.line(" reference", m.reference);
    lines.line(" sizes", m.size_ratio(), m.mirrored(), m.correlation_at(m.best_rotation()),
               m.most_lost(C.cast<double>(), 0.5), m.most_lost(Eigen::Matrix3d::Identity(), 0.2),
               m.best_rotation());
  }
  lines.line("common", moments.common_rotation(), moments.mean_force_gap_mps2(C.cast<double>()),
             moments.mean_force_gap_mps2(Eigen::Matrix3d::Identity()));
  TriadMoments mirrored = moments.rates;
  mirrored.study_reference.row(0) *= -1.0;
  lines.line("mirrored", mirrored.mirrored(), mirrored.best_rotation());
  expect_recorded("estimation/batch/pair_moments.txt", lines.text(), 1e-6, 1e-9);
}

using synthetic::Pair;
using synthetic::PairOptions;

void add_start(Answer& lines, std::string_view name, const Pair& pair, double search_s = 3.0) {
  const auto start = find_start(pair.reference, pair.study, search_s);
  if (!start) {
    lines.line(name, start.error().kind, start.error().text());
    return;
  }
  lines.line(name, start->time_offset_s, start->rate_correlation, start->C_b_s);
}

/// The S-IMU's triads through matrices that need not be rotations.
Pair through(const Pair& pair, const Eigen::Matrix3f& gyro, const Eigen::Matrix3f& accel) {
  Pair out = pair;
  for (auto& omega : out.study.omega_radps) omega = (gyro * omega).eval();
  for (auto& f : out.study.f_mps2) f = (accel * f).eval();
  return out;
}

/// Of a record, what lies in [from, to).
ImuRecord cut(const ImuRecord& record, double from_s, double to_s) {
  ImuRecord out;
  for (std::size_t i = 0; i < record.size(); ++i)
    if (record.time_s[i] >= from_s && record.time_s[i] < to_s)
      out.add(record.time_s[i], record.omega_radps[i], record.f_mps2[i]);
  return out;
}

TEST(BatchPartsAnswers, Start) {
  Answer lines;
  PairOptions options;
  options.duration_s = 60.0;
  options.C_b_s = imuscope::exp_so3({0.5, -2.0, 1.0});
  const Pair pair = synthetic::make_pair(options, 3);
  const Eigen::Matrix3f same = Eigen::Matrix3f::Identity();
  add_start(lines, "plain", pair);
  add_start(lines, "narrow search", pair, 0.5);
  for (const float factor : {1.4F, 1.6F, 0.7F, 0.6F, 19.0F, 25.0F, 57.29578F, 0.0174533F, 80.0F})
    add_start(lines, "rates times", through(pair, factor * same, same));
  for (const float factor : {1.3F, 1.4F, 0.7F, 0.6F, 0.101972F, 0.05F})
    add_start(lines, "forces times", through(pair, same, factor * same));
  Eigen::Matrix3f mirror = same;
  mirror(1, 1) = -1.0F;
  add_start(lines, "mirrored rates", through(pair, mirror, same));
  add_start(lines, "mirrored forces", through(pair, same, mirror));
  for (const double angle : {0.2, 0.35, 0.5, 1.2}) {
    const Eigen::Matrix3f turn = imuscope::exp_so3(Eigen::Vector3d(0.6, 0.0, 0.8) * angle).cast<float>();
    add_start(lines, "turned forces", through(pair, same, turn));
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Pair stuck = pair;
    for (auto& omega : stuck.study.omega_radps) omega[axis] = 0.25F;
    add_start(lines, "stuck gyro", stuck);
    stuck = pair;
    for (auto& f : stuck.reference.f_mps2) f[axis] = -1.5F;
    add_start(lines, "stuck accelerometer", stuck);
  }
  add_start(lines, "copy", {pair.reference, pair.reference});
  add_start(lines, "45.9 s", {cut(pair.reference, 0.0, 45.9), pair.study});
  add_start(lines, "46.5 s", {cut(pair.reference, 0.0, 46.5), pair.study});
  add_start(lines, "two samples", {cut(pair.reference, 0.0, 0.02), pair.study});
  add_start(lines, "apart", {cut(pair.reference, 0.0, 28.0), cut(pair.study, 30.0, 60.0)});
  options.motion = 0.0;
  options.study_gyro_white = 3e-3;
  add_start(lines, "rest", synthetic::make_pair(options, 3));
  options.motion = 1.0;
  options.study_gyro_white = 0.05;
  add_start(lines, "noisy", synthetic::make_pair(options, 3));
  expect_recorded("estimation/batch/start.txt", lines.text(), 1e-4, 1e-7);
}

TEST(BatchPartsAnswers, CommonInstantsLieWithinBothRecordsByTheKernelsReach) {
  const Eigen::Vector3f none = Eigen::Vector3f::Zero();
  ImuRecord reference;
  ImuRecord study;
  for (int i = 0; i <= 100; ++i) reference.add(0.1 * i, none, none);
  for (int i = 0; i <= 60; ++i) study.add(2.0 + 0.1 * i, none, none);
  // 2 s to 8 s of the S-IMU are 2.5 s to 8.5 s of the reference; half a second goes at both ends.
  const auto instants = common_instants(reference, study, 0.5, 50.0);
  ASSERT_EQ(instants.size(), 250U);
  EXPECT_NEAR(instants.front(), 3.0, 1e-12);
  EXPECT_NEAR(instants[1] - instants[0], 0.02, 1e-12);
  EXPECT_NEAR(instants.back(), 7.98, 1e-9);
  EXPECT_NEAR(common_instants(study, reference, 0.0, 10.0).front(), 2.5, 1e-12);
  EXPECT_TRUE(common_instants(reference, study, 7.0, 50.0).empty())
      << "9 s to 10 s, of which nothing is left";
  EXPECT_TRUE(common_instants(reference, study, 20.0, 50.0).empty());
}

}  // namespace
