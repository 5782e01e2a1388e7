/// Everything that the parts of the calibration return, over rich inputs: what is right about it, the tests beside this
/// one prove against closed forms, differences and dense algebra.

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "estimation/calibration/axis_gate.h"
#include "estimation/calibration/combine.h"
#include "estimation/calibration/drive_scatter.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/gnss_trust.h"
#include "estimation/calibration/navigation_output.h"
#include "estimation/calibration/regime_detector.h"
#include "estimation/calibration/smoother.h"
#include "estimation/calibration/state_name.h"
#include "estimation/calibration/update_window.h"
#include "estimation/navigation/so3.h"
#include "estimator_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::Answer;

/// Numbers that are all unlike, between -1 and 1.
double unlike(std::size_t i) { return std::sin(12.9898 * static_cast<double>(i + 1)); }

ReferenceKinematics lively_motion(std::size_t seed = 0) {
  ReferenceKinematics b;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    b.omega_radps(k) = 0.5 * unlike(seed + i);
    b.omega_dot_radps2(k) = 2.0 * unlike(seed + i + 10);
    b.omega_ddot_radps3(k) = 9.0 * unlike(seed + i + 20);
    b.f_mps2(k) = 3.0 * unlike(seed + i + 30) - (i == 2 ? 9.8 : 0.0);
    b.f_dot_mps3(k) = 7.0 * unlike(seed + i + 40);
  }
  return b;
}

SImuState lively_state() {
  SImuState s;
  s.C_b_s = exp_so3({0.4, -1.1, 2.0});
  s.r_bs_b_m = {0.4, -0.9, 0.3};
  s.gyro_bias_s_radps = {0.01, -0.02, 0.03};
  s.accel_bias_s_mps2 = {0.1, -0.2, 0.3};
  s.t_d_s = 0.004;
  s.gyro_scale = {0.003, -0.004, 0.005};
  s.accel_scale = {-0.002, 0.006, 0.001};
  s.accel_turn = exp_so3({0.02, -0.03, 0.01});
  s.accel_t_d_s = -0.002;
  s.gyro_axes = {0.001, -0.002, 0.0015};
  s.accel_axes = {-0.0012, 0.0007, 0.0021};
  for (Eigen::Index i = 0; i < 6; ++i) s.places_s_m(i) = 0.02 * unlike(static_cast<std::size_t>(i) + 60);
  for (Eigen::Index i = 0; i < 9; ++i)
    s.g_sensitivity(i / 3, i % 3) = 1e-3 * unlike(static_cast<std::size_t>(i) + 70);
  return s;
}

void add_measurement(Answer& lines, std::string_view name, const SImuMeasurement& m) {
  lines.line(name, m.predicted, m.H.count);
  lines.line(" of reference", Matrix3d(1e6 * m.reference_covariance));
  for (std::size_t i = 0; i < m.H.count; ++i) {
    const MeasurementBlock& block = m.H.blocks[i];
    lines.line(" block", block.column, block.width, block.h[0], block.h[1], block.h[2]);
  }
}

void add_state(Answer& lines, const SImuState& s) {
  lines.line("state", s.C_b_s, s.accel_turn);
  lines.line(" vectors", s.r_bs_b_m, s.gyro_bias_s_radps, s.accel_bias_s_mps2, s.t_d_s, s.accel_t_d_s);
  lines.line(" shapes", s.gyro_scale, s.accel_scale, s.gyro_axes, s.accel_axes, s.places_s_m);
  lines.line(" g", s.g_sensitivity);
}

TEST(CalibrationParts, SImuModel) {
  Answer lines;
  const SImuState state = lively_state();
  ReferenceMean mean;
  mean.add(0.5, lively_motion(0));
  mean.add(1.5, lively_motion(100));
  mean.scale(0.4);
  mean.move(0.03);
  mean.compensate({0.01, 0.02, -0.03}, {0.1, -0.2, 0.3});
  lines.line("mean", mean.omega_radps, mean.omega_dot_radps2, mean.omega_ddot_radps3, mean.f_mps2,
             mean.f_dot_mps3);
  lines.line("products", mean.omega_omega);
  const ReferenceMean other(lively_motion(200));
  for (const std::uint32_t blocks :
       {kCompleteSImuBlocks, kFullSImuBlocks, kPaperSImuBlocks, kBiasSImuBlocks,
        kCompleteSImuBlocks & ~kTimeOffsetBlock,
        static_cast<std::uint32_t>(kAccelTimeOffsetBlock | kAccelPlacesBlock | kGyroAxesBlock)}) {
    const SImuLayout l = SImuLayout::make(blocks, 15);
    const auto at = [](std::size_t first) {
      return first == SImuLayout::kAbsent ? -1.0 : static_cast<double>(first);
    };
    lines.line("layout", blocks, l.first, l.size, at(l.psi), at(l.r), at(l.gyro_bias), at(l.accel_bias),
               at(l.t_d), at(l.gyro_scale), at(l.accel_scale), at(l.accel_boresight), at(l.accel_t_d),
               at(l.gyro_axes), at(l.accel_axes), at(l.places), at(l.g_sensitivity));
    const ReferenceBiasColumns columns =
        blocks == kPaperSImuBlocks ? ReferenceBiasColumns{} : ReferenceBiasColumns{9, 12};
    add_measurement(lines, "gyro", gyro_measurement(state, l, columns, mean, other, {1e-3, 2e-2, 3e-3}));
    add_measurement(lines, "accel", accel_measurement(state, l, columns, mean, other, {1e-3, 2e-2, 3e-3}));
    std::vector<double> error(70);
    for (std::size_t i = 0; i < error.size(); ++i) error[i] = 0.01 * unlike(i + 5);
    SImuState corrected = state;
    inject(corrected, l, error);
    add_state(lines, corrected);
  }
  lines.line("rate", predicted_rate(state, mean), "force", predicted_force(state, mean));
  LinearisationSpread spread;
  spread.psi_rad2 << 0.02, 0.001, -0.003, 0.001, 0.03, 0.002, -0.003, 0.002, 0.05;
  spread.r_m2 << 0.3, 0.02, -0.05, 0.02, 0.2, 0.04, -0.05, 0.04, 0.4;
  spread.t_d_s2 = 1e-4;
  lines.line("second order of rates", second_order_rate(state, mean, spread));
  lines.line("second order of forces", second_order_force(state, mean, spread));
  for (const double tau_s : {0.0, 0.01, 0.6})
    lines.line("inflated", tau_s, inflated_variance(0.1, 0.05, tau_s, 0.01));
  test::expect_recorded("estimation/calibration/s_imu_model.txt", lines.text(), 1e-6, 1e-11);
}

TEST(CalibrationParts, UpdateWindows) {
  Answer lines;
  for (const int n : {1, 4, 10})
    for (int k = 0; k <= 2 * n; k += std::max(1, n / 2))
      lines.line("weight", n, k, window_weight(n, k), window_white_share(n));
  for (const int points : {5, 9}) {
    for (const double rate_hz : {100.0, 30.0, 400.0}) {
      const ReferenceWindowOptions reference{points, 0.01};
      for (const int n : {1, 3, 20}) {
        const NoiseGains g = noise_gains(reference, rate_hz, n);
        lines.line("gains", points, rate_hz, n, g.value, g.slope_per_s, g.curvature_per_s2);
      }
      WindowChoice choice(reference, rate_hz);
      lines.line("first", choice.now().n, choice.now().gains.slope_per_s);
      choice.fix(0);
      MotionShare share;
      share.set_noise(0.02, 0.03, choice.now().gains);
      for (int i = 0; i < 900; ++i) {
        // Rest, hardly any motion, lively motion, rest.
        const double size = i < 100 ? 0.0 : i < 450 ? 0.05 : i < 800 ? 3.0 : 0.0;
        ReferenceKinematics b = lively_motion(static_cast<std::size_t>(i));
        for (Vector3d* v : {&b.omega_radps, &b.omega_dot_radps2, &b.omega_ddot_radps3, &b.f_dot_mps3})
          *v *= size;
        b.f_mps2 = Vector3d(0.1, 0.2, -9.8) + size * (b.f_mps2 + Vector3d(0.0, 0.0, 9.8));
        share.add(ReferenceMean(b), {0.01, -0.02, 0.03}, {0.1, 0.0, -0.1}, 0.1);
        const bool changed = choice.choose(share);
        if (changed) {
          lines.line("changed", i, choice.now().n, choice.now().gains.slope_per_s);
          share.set_noise(0.02, 0.03, choice.now().gains);
        }
        if (i % 75 != 2) continue;
        lines.line("share", i, share.can_tell(), share.moving(), share.rate_slope_share(),
                   share.noise_in_rate_slope(), share.motion_s());
        const ReferenceMean believed = share.believed(ReferenceMean(b));
        lines.line(" believed", believed.omega_radps, believed.omega_dot_radps2, believed.omega_ddot_radps3,
                   believed.f_mps2, believed.f_dot_mps3, believed.omega_omega.diagonal());
        const ReferenceMean expected = share.expected(ReferenceMean(b));
        lines.line(" expected", expected.omega_radps, expected.omega_dot_radps2, expected.f_mps2);
      }
      share.clear();
      lines.line("cleared", share.can_tell(), share.moving(), share.motion_s(), share.noise_in_rate_slope());
      choice.fix(7);
      lines.line("fixed", choice.now().n, choice.now().gains.value);
    }
  }
  test::expect_recorded("estimation/calibration/update_windows.txt", lines.text(), 1e-6, 1e-9);
}

/// Covariance of (psi, r) with every correlation, of the given size.
std::array<double, 36> lively_covariance(std::size_t seed, double size) {
  Eigen::Matrix<double, 6, 6> root;
  for (Eigen::Index i = 0; i < 36; ++i) root.data()[i] = unlike(seed + static_cast<std::size_t>(i));
  Eigen::Matrix<double, 6, 6> P =
      size * size * (root * root.transpose() + Eigen::Matrix<double, 6, 6>::Identity());
  P.bottomRows<3>() *= 10.0;
  P.rightCols<3>() *= 10.0;
  std::array<double, 36> out{};
  Eigen::Map<Eigen::Matrix<double, 6, 6>>(out.data()) = P;
  return out;
}

MountingEstimate drive_estimate(std::size_t seed, double off, bool shares) {
  MountingEstimate e;
  const Vector3d psi(off * unlike(seed), off * unlike(seed + 1), off * unlike(seed + 2));
  e.C_b_s = to_array(Matrix3d(exp_so3({0.3, -1.2, 2.0}) * exp_so3(psi)));
  e.r_bs_b_m = {0.35 + 10.0 * off * unlike(seed + 3), -0.22 + 10.0 * off * unlike(seed + 4),
                0.12 + 10.0 * off * unlike(seed + 5)};
  e.covariance_psi_r = lively_covariance(seed, 1e-3);
  if (shares)
    for (std::size_t i = 0; i < 12; ++i) e.shared_psi_r.push_back(3e-4 * unlike(seed + 90 + i));
  return e;
}

void add_combined(Answer& lines, std::string_view name, const std::vector<MountingEstimate>& estimates) {
  for (const CombineMethod method :
       {CombineMethod::kInverseVariance, CombineMethod::kCovarianceIntersection}) {
    const Result<CombinedMounting> found = combine(estimates, method);
    if (!found) {
      lines.line(name, found.error().text());
      continue;
    }
    lines.line(name, estimates.size(), found->estimate.C_b_s, found->estimate.r_bs_b_m);
    std::array<double, 36> scaled = found->estimate.covariance_psi_r;
    for (double& value : scaled) value *= 1e6;
    lines.line(" covariance", scaled);
    lines.line(" weights", found->weights);
    lines.line(" homogeneity", found->homogeneity_chi2, found->homogeneity_dof, found->homogeneity_p_value,
               found->between_drives_psi_sd_rad, found->between_drives_r_sd_m, found->one_mounting_p_value());
    for (const DriveDeviation& d : found->drives)
      lines.line(" drive", d.deviation, d.deviation_sd, d.p_value);
  }
}

TEST(CalibrationParts, Combination) {
  Answer lines;
  for (const bool shares : {false, true}) {
    for (const double off : {5e-4, 6e-3}) {
      for (const std::size_t n : {1U, 2U, 3U, 5U}) {
        std::vector<MountingEstimate> estimates;
        for (std::size_t i = 0; i < n; ++i) estimates.push_back(drive_estimate(7 * i, off, shares));
        add_combined(lines, shares ? "sharing" : "independent", estimates);
      }
    }
  }
  std::vector<MountingEstimate> one_off;
  for (std::size_t i = 0; i < 4; ++i) one_off.push_back(drive_estimate(5 * i, i == 2 ? 0.05 : 3e-4, false));
  add_combined(lines, "one drive is off", one_off);
  // What is not told of all in the same terms is told of none.
  std::vector<MountingEstimate> unlike_shares{drive_estimate(0, 1e-3, true), drive_estimate(7, 1e-3, false)};
  add_combined(lines, "of one alone", unlike_shares);
  unlike_shares[1].shared_psi_r.assign(7, 1e-4);
  unlike_shares[0].shared_psi_r.assign(7, 1e-4);
  add_combined(lines, "no whole rows", unlike_shares);
  add_combined(lines, "none", {});
  one_off[1].covariance_psi_r[0] = -1.0;
  add_combined(lines, "not positive", one_off);
  one_off[1].covariance_psi_r[0] = std::nan("");
  add_combined(lines, "no number", one_off);
  test::expect_recorded("estimation/calibration/combination.txt", lines.text(), 1e-5, 1e-9);
}

TEST(CalibrationParts, WeightedMeanOfTheLiterature) {
  WeightedMean mean;
  EXPECT_EQ(mean.mean(), 0.0);
  EXPECT_EQ(mean.claimed_sd(), 0.0);
  mean.add(1.0, 0.5);
  mean.add(4.0, 1.0);
  EXPECT_DOUBLE_EQ(mean.mean(), 1.6);
  EXPECT_DOUBLE_EQ(mean.claimed_sd(), 1.0 / std::sqrt(5.0));
}

TEST(CalibrationParts, TrustInGnssAndGates) {
  Answer lines;
  GnssConfig config;
  config.default_sd_velocity_mps = {0.03, 0.04, 0.06};
  for (const GnssSolution solution : {GnssSolution::kNone, GnssSolution::kSingle, GnssSolution::kDifferential,
                                      GnssSolution::kFloat, GnssSolution::kFixed}) {
    GnssData gnss{};
    gnss.solution = solution;
    gnss.sd_position_m = {0.3, 0.001, 0.5};
    gnss.sd_velocity_mps = {0.2, 0.3, 0.001};
    for (const std::uint32_t flags :
         {0U, static_cast<std::uint32_t>(kHasPositionSd), static_cast<std::uint32_t>(kHasVelocitySd)}) {
      gnss.flags = flags;
      lines.line("sd", solution, flags, trusted_position_sd(gnss, config), trusted_velocity_sd(gnss, config));
    }
    for (const double since_s : {-1.0, 0.0, 0.2, 1.0, 59.0, 61.0, 300.0})
      lines.line("factor", solution, since_s, correlated_sd_factor(solution, since_s));
  }
  for (const double p : {0.9, 0.95, 0.99999}) lines.line("gate", p, axis_gate(p));
  test::expect_recorded("estimation/calibration/gnss_trust.txt", lines.text());
}

TEST(CalibrationParts, StateNames) {
  Answer lines;
  EstimatorConfig config;
  config.studies.resize(2);
  config.studies[0].blocks = kCompleteSImuBlocks;
  config.studies[1].blocks = kPaperSImuBlocks;
  for (const bool more : {false, true}) {
    config.odometry.enabled = more;
    config.gnss.enabled = true;
    for (std::size_t i = more ? 59 : 0; i < 80; ++i) {
      const StateName name = state_name(config, i);
      lines.line(name.name, i, name.study ? static_cast<double>(*name.study) : -1.0);
    }
  }
  test::expect_recorded("estimation/calibration/state_names.txt", lines.text());
}

TEST(CalibrationParts, NoiseOfTheMtxClass) {
  Answer lines;
  const SImuNoise noise = mtx_class_noise();
  for (const auto& triads : {noise.gyro, noise.accel})
    for (const TriadNoise& t : triads) lines.line("triad", t.white_sd, t.fast_sd, t.fast_time_constant_s);
  for (const auto& biases : {noise.gyro_bias, noise.accel_bias})
    for (const GaussMarkovConfig& b : biases) lines.line("bias", b.sd, b.time_constant_s);
  test::expect_recorded("estimation/calibration/mtx_class.txt", lines.text());
}

TEST(CalibrationParts, RegimeDetector) {
  Answer lines;
  for (const bool wheels : {false, true}) {
    RegimeDetector detector;
    Regime before = detector.regime();
    for (int i = 0; i < 6000; ++i) {
      const double t = 0.01 * i;
      // Rest, a soft shake, a drive, rest, a turn on the spot.
      const double shake = t > 10.0 && t < 20.0 ? 0.13 : t > 20.0 && t < 35.0 ? 1.0 : 0.0;
      const double turn = t > 45.0 && t < 50.0 ? 0.02 : 0.0;
      if (wheels && i % 10 == 0 && (t < 25.0 || t > 40.0))
        detector.add_wheel_speed(t > 20.0 && t < 35.0 ? -5.0 : t > 5.0 && t < 6.0 ? 0.06 : 0.05);
      detector.add({shake * 0.02 * std::sin(3.0 * t), 0.0, turn * std::sin(2.0 * t)},
                   {shake * std::sin(4.0 * t), 0.1 * std::sin(200.0 * t), -9.8}, 0.01);
      if (detector.regime() != before) lines.line("becomes", wheels, t, detector.regime());
      before = detector.regime();
      if (i % 500 == 499) lines.line("mean", t, detector.mean_f_mps2());
    }
  }
  test::expect_recorded("estimation/calibration/regime_detector.txt", lines.text());
}

TEST(CalibrationParts, NavigationAsItIsShown) {
  Answer lines;
  std::array<double, 15> sd{};
  for (std::size_t i = 0; i < sd.size(); ++i) sd[i] = 0.1 * static_cast<double>(i + 1);
  Matrix3d P_phi;
  P_phi << 0.04, 0.01, -0.005, 0.01, 0.09, 0.02, -0.005, 0.02, 0.16;
  for (const Vector3d& turn : {Vector3d(0.1, -0.4, 2.0), Vector3d(0.0, 0.5 * kPi, 0.0)}) {
    NavigationState state;
    state.position = {0.8, 0.1, 400.0};
    state.v_n_mps = {1.0, 2.0, 3.0};
    state.C_b_n = exp_so3(turn);
    state.gyro_bias_b_radps = {0.01, 0.02, 0.03};
    state.accel_bias_b_mps2 = {0.1, 0.2, 0.3};
    NavigationOutput out;
    write_state(state, sd, P_phi, out);
    lines.line("shown", out.latitude_rad, out.longitude_rad, out.height_m, out.v_n_mps, out.rpy_rad,
               out.C_b_n);
    lines.line(" biases", out.gyro_bias_radps, out.accel_bias_mps2);
    lines.line(" sd", out.sd_position_m, out.sd_velocity_mps, out.sd_rpy_rad, out.sd_gyro_bias_radps,
               out.sd_accel_bias_mps2);
  }
  test::expect_recorded("estimation/calibration/navigation_output.txt", lines.text(), 1e-5, 1e-9);
}

/// A core with every kind of state, whose covariance has all correlations.
struct LivelyCore {
  EstimatorConfig config;
  std::unique_ptr<FilterCore> core;

  LivelyCore() {
    config.instruction_set = InstructionSet::kBaseline;
    config.gnss.enabled = true;
    config.gnss.latency_s = 0.03;
    config.gnss.antenna_lever_arm_b_m = {1.0, 2.0, -1.5};
    config.odometry.enabled = true;
    config.odometry.prior_r_bv_b_m = {0.3, 0.2, 0.1};
    config.studies.resize(2);
    config.studies[0].blocks = kCompleteSImuBlocks;
    config.studies[0].prior_r_bs_b_m = {0.4, -0.3, 0.2};
    config.studies[0].prior_gyro_bias_radps = {0.01, 0.02, 0.03};
    config.studies[0].prior_accel_bias_mps2 = {0.1, 0.2, 0.3};
    config.studies[0].prior_gyro_scale = {0.001, 0.002, 0.003};
    config.studies[0].prior_accel_scale = {0.004, 0.005, 0.006};
    config.studies[1].blocks = kBiasSImuBlocks | kTimeOffsetBlock;
    core = std::make_unique<FilterCore>(config);
    core->keep_history();
  }
  void correlate() {
    CovarianceKernel& P = core->covariance();
    const std::size_t n = P.dimension();
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j <= i; ++j)
        P.set(i, j, (i == j ? 1.0 + 0.1 * unlike(i) : 0.3 / static_cast<double>(n) * unlike(31 * i + j)));
  }
  /// Every element of the covariance counts in one of these.
  void add(Answer& lines, std::string_view name) const {
    const CovarianceKernel& P = core->covariance();
    std::vector<double> sums;
    for (std::size_t i = 0; i < P.dimension(); ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < P.dimension(); ++j) sum += P(i, j) * unlike(j);
      sums.push_back(sum);
    }
    lines.line(name, P.dimension(), P.padded_dimension(), sums);
  }
};

void add_states(Answer& lines, FilterCore& core) {
  core.settle();
  const NavigationState& n = core.navigation();
  lines.line("navigation", 1e6 * n.position.latitude_rad, 1e6 * n.position.longitude_rad, n.position.height_m,
             n.v_n_mps, n.C_b_n);
  lines.line(" biases", core.reference_gyro_bias_radps(), core.reference_accel_bias_mps2());
  for (std::size_t i = 0; i < core.study_count(); ++i) add_state(lines, core.study(i));
  lines.line("odometry", core.odometry_states(), core.odometry().C_b_v, core.odometry().r_bv_b_m,
             core.odometry().scale);
  lines.line("antenna", core.antenna_states(), core.antenna().r_ba_b_m, core.antenna().latency_s);
}

TEST(CalibrationParts, FilterCore) {
  Answer lines;
  LivelyCore lively;
  FilterCore& core = *lively.core;
  add_states(lines, core);
  lively.add(lines, "at first");
  std::vector<double> sd;
  for (std::size_t i = 0; i < core.covariance().dimension(); ++i) sd.push_back(core.sd(i));
  lines.line("sd", sd, core.sd(SImuLayout::kAbsent));
  lively.correlate();
  NavigationState& state = core.navigation();
  state.position = {0.8, 0.1, 400.0};
  state.v_n_mps = {10.0, -5.0, 1.0};
  state.C_b_n = exp_so3({0.1, -0.4, 2.0});
  core.predict_navigation(
      transition(state, {{0.1, 0.2, 0.3}, {1.0, 2.0, -9.0}}, {0.1, 0.2, {0.3, 50.0}, {0.4, 70.0}}, 0.1));
  core.predict_state(core.layout(0).psi + 1, 1.0, 0.25);
  core.predict_states(core.layout(0).gyro_bias, std::array{0.9, 0.8, 0.7}, std::array{0.1, 0.2, 0.3});
  lively.add(lines, "predicted");
  SparseMeasurement H;
  for (const auto& [column, width] :
       std::initializer_list<std::pair<std::size_t, std::size_t>>{{3, 3},
                                                                  {core.layout(0).psi, 3},
                                                                  {core.layout(0).t_d, 1},
                                                                  {core.layout(1).accel_bias, 2},
                                                                  {core.antenna_states(), 3},
                                                                  {core.odometry_states(), 3}}) {
    MeasurementBlock& block = H.append(column, width);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < width; ++j) block.h[i][j] = unlike(7 * column + 3 * i + j);
  }
  const std::array<double, 9> R{0.5, 0.1, 0.0, 0.1, 0.4, -0.1, 0.0, -0.1, 0.6};
  for (const std::array<bool, 3>& use : {std::array{true, true, true}, std::array{false, true, true},
                                         std::array{true, false, false}, std::array{false, false, false}}) {
    core.covariance().project(H, R);
    lines.line("S", core.covariance().innovation_covariance());
    lines.line("updated", core.update({0.3, -0.2, 0.1}, use));
    lines.line("injected", core.injected());
    lively.add(lines, "P");
    add_states(lines, core);
  }
  core.predict_navigation(transition(core.navigation(), {{0.3, 0.1, 0.2}, {2.0, 1.0, -9.5}},
                                     {0.1, 0.2, {0.3, 50.0}, {0.4, 70.0}}, 0.05));
  const FilterCore::Accumulated& accumulated = core.accumulated();
  lines.line("transition", Eigen::MatrixXd(accumulated.transition));
  lines.line("noise", Eigen::MatrixXd(accumulated.noise));
  lines.line("decay", accumulated.decay);
  lines.line("decay noise", accumulated.decay_noise);
  lines.line("accumulated corrections", accumulated.injected);
  lines.line("taken", core.take_injected(), core.injected());
  core.restart_accumulation();
  lines.line("anew", core.accumulated().transition.sum(), core.accumulated().noise.sum(),
             std::accumulate(core.accumulated().decay.begin(), core.accumulated().decay.end(), 0.0),
             std::accumulate(core.accumulated().injected.begin(), core.accumulated().injected.end(), 0.0));
  core.reset_state(core.layout(0).r, 4.0);
  core.reset_latency(0.07, 0.02);
  lively.add(lines, "reset");
  lines.line("latency", core.antenna().latency_s, core.accumulated().decay[core.antenna_states() + 3 - 15]);
  reset_to_prior(core, 0, lively.config.studies[0]);
  lively.add(lines, "to its prior");
  add_states(lines, core);
  core.covariance().set(4, 4, -1.0);
  core.covariance().set(20, 20, std::nan(""));
  std::size_t first = 0;
  const std::size_t repaired = core.repair(first);
  lines.line("repaired", repaired, first);
  lively.add(lines, "after that");
  core.repair_state(30);
  lines.line("repaired one", core.sd(30));
  lines.line("nothing more", core.repair(first));
  lines.line("every one");
  for (std::size_t i = 0; i < core.covariance().dimension(); ++i) {
    core.repair_state(i);
    lines.line(i, core.sd(i));
  }
  test::expect_recorded("estimation/calibration/filter_core.txt", lines.text(), 1e-6, 1e-10);
}

TEST(CalibrationParts, SmoothingStep) {
  Answer lines;
  constexpr Eigen::Index kN = 19;
  const auto matrix = [](Eigen::Index n, std::size_t seed) {
    return Eigen::MatrixXd::NullaryExpr(n, n,
                                        [=](Eigen::Index i, Eigen::Index j) {
                                          return unlike(seed + static_cast<std::size_t>(n * i + j));
                                        })
        .eval();
  };
  const auto positive = [&](Eigen::Index n, std::size_t seed) {
    const Eigen::MatrixXd root = matrix(n, seed);
    return Eigen::MatrixXd(root * root.transpose() + Eigen::MatrixXd::Identity(n, n));
  };
  const Eigen::MatrixXd P = positive(kN, 3);
  const Eigen::Matrix<double, 15, 15> transition =
      Eigen::Matrix<double, 15, 15>::Identity() + 0.1 * matrix(15, 900);
  const Eigen::Matrix<double, 15, 15> noise = 0.1 * positive(15, 1200);
  Eigen::VectorXd decay(kN - 15);
  decay << 0.9, 0.0, 1.0, 0.8;
  Eigen::VectorXd decay_noise(kN - 15);
  decay_noise << 0.3, 2.0, 0.0, 0.1;
  const Eigen::VectorXd injected = Eigen::VectorXd::NullaryExpr(
      kN, [](Eigen::Index i) { return unlike(static_cast<std::size_t>(i) + 77); });
  Eigen::VectorXd d = 2.0 * injected.reverse();
  Eigen::MatrixXd smoothed = 0.5 * positive(kN, 2000);
  smooth_back({P, transition, noise, decay, decay_noise, injected}, d, smoothed);
  lines.line("d", d);
  lines.line("P", smoothed);
  test::expect_recorded("estimation/calibration/smoothing_step.txt", lines.text(), 1e-6, 1e-8);
}

TEST(CalibrationParts, TheFirstStateThatIsACombinationOfOthersIsNamed) {
  CovarianceKernel P(19, InstructionSet::kBaseline);
  for (std::size_t i = 0; i < 19; ++i)
    for (std::size_t j = 0; j <= i; ++j) P.set(i, j, i == j ? 2.0 : 0.05 * unlike(19 * i + j));
  EXPECT_FALSE(P.first_bad_state());
  P.reset_state(3, 0.0);
  EXPECT_FALSE(P.first_bad_state()) << "known exactly";
  P.set(11, 11, P(10, 10));
  for (std::size_t j = 0; j < 19; ++j)
    if (j != 11 && j != 10) P.set(11, j, P(10, j));
  P.set(11, 10, P(10, 10));
  EXPECT_EQ(P.first_bad_state(), 11U);
  P.reset_state(11, 1.0);
  EXPECT_FALSE(P.first_bad_state());
  P.set(16, 16, -1e-9);
  EXPECT_EQ(P.first_bad_state(), 16U);
  P.set(5, 5, std::nan(""));
  EXPECT_EQ(P.first_bad_state(), 5U);
}

}  // namespace
}  // namespace imuscope
