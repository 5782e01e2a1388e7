#include "estimation/navigation/initial_alignment.h"

#include <algorithm>
#include <cmath>

#include "estimation/navigation/gravity.h"
#include "estimation/navigation/heading_solver.h"
#include "estimation/navigation/wgs84.h"

namespace imuscope {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kGap_s = 0.5;

// Rest: means over half a second, so that an idling engine does not hide it.
constexpr double kBlock_s = 0.5;
constexpr double kRestRateMax_radps = 2.0 * kRadPerDeg;  ///< MEMS turn-on bias included
constexpr double kRestRateChange_radps = 0.15 * kRadPerDeg;
constexpr double kRestForceChange_mps2 = 0.15;
constexpr double kGnssMotion_mps = 1.0;
constexpr double kGnssMotionHold_s = 1.0;
constexpr double kGnssMotionSds = 4.0;

/// A parked vehicle sways by this much over a rest (wind, people); over the averaging time it is a rate
/// error.
constexpr double kSway_rad = 5e-5;

constexpr double kNodeSpacing_s = 0.45;
/// Half of a window for the heading. Long enough for centimetres to matter little, short enough for tilt.
constexpr double kHalfWindow_s = 3.0;
constexpr double kHalfWindowMax_s = 2.0 * kHalfWindow_s;
constexpr double kScaleMin = 0.75;
constexpr double kScaleMax = 1.33;
/// Outliers may cost this share of the windows' weight.
constexpr double kWeightShareMin = 0.5;
constexpr double kGyroBiasSdMin_radps = 1e-7;
constexpr double kAccelerationSdMin_mps2 = 1e-3;

constexpr double kFitSpan_s = 4.0;
constexpr double kFitSpanMin_s = 1.5;
constexpr double kFitResidualMax_m = 2.0;
constexpr double kNewestNodeAgeMax_s = 2.5;
constexpr double kVelocityAgeMax_s = 1.0;
constexpr double kVelocitySdMin_mps = 0.02;

double square(double x) noexcept { return x * x; }

Matrix3d about_down(double angle_rad) noexcept { return rotation_from_euler({0.0, 0.0, angle_rad}); }

double heading_of(const Matrix3d& C) noexcept { return euler_from_rotation(C).heading_rad; }

}  // namespace

// N-40: at rest the specific force points up.
InitialAttitude level_from_rest(const Vector3d& mean_f_b_mps2, double sd_f_mps2,
                                double heading_rad) noexcept {
  const Vector3d f = mean_f_b_mps2.normalized();
  EulerAngles angles;
  angles.roll_rad = std::atan2(-f.y(), -f.z());
  angles.pitch_rad = std::atan2(f.x(), std::hypot(f.y(), f.z()));
  angles.heading_rad = heading_rad;
  const double tilt_sd = sd_f_mps2 / mean_f_b_mps2.norm();
  return {rotation_from_euler(angles), Vector3d(tilt_sd, tilt_sd, kPi)};
}

// N-41: in the level frame the Earth's rate shows (cos L cos h, -cos L sin h, -sin L).
InitialAttitude gyrocompass(const Vector3d& mean_omega_ib_b_radps, const Vector3d& mean_f_b_mps2,
                            double sd_omega_radps, double sd_f_mps2, double latitude_rad) noexcept {
  InitialAttitude level = level_from_rest(mean_f_b_mps2, sd_f_mps2, 0.0);
  const Vector3d omega = level.C_b_n * mean_omega_ib_b_radps;
  level.C_b_n = about_down(std::atan2(-omega.y(), omega.x())) * level.C_b_n;
  // A tilt about north turns the vertical Earth rate into the east gyro.
  const double east_error =
      std::hypot(sd_omega_radps, level.sd_n_rad.x() * kEarthRate_radps * std::sin(std::abs(latitude_rad)));
  level.sd_n_rad.z() = std::min(kPi, east_error / (kEarthRate_radps * std::cos(latitude_rad)));
  return level;
}

InitialAligner::InitialAligner(const InitialAlignmentOptions& options) noexcept : options_(options) {}

const InitialNavigation* InitialAligner::result() const noexcept {
  return stage_ == AlignmentStage::kDone ? &result_ : nullptr;
}

double InitialAligner::seconds(HostTime time) const noexcept { return to_seconds(time - origin_time_); }

const InitialAligner::Node& InitialAligner::node(std::size_t age) const noexcept {
  return nodes_[(node_count_ - 1 - age) % kNodes];
}

std::size_t InitialAligner::nodes_held() const noexcept { return std::min(node_count_, kNodes); }

Matrix3d InitialAligner::C_a_n() const noexcept {
  return about_down(heading_of_a_rad_) * exp_so3(tilt_error_a_rad_);
}

void InitialAligner::restart() noexcept {
  const InitialAlignmentOptions options = options_;
  *this = InitialAligner(options);
}

void InitialAligner::add_imu(HostTime time, const InertialRates& measured,
                             double true_per_host_second) noexcept {
  if (!measured.omega_ib_b_radps.allFinite() || !measured.f_b_mps2.allFinite()) return;
  if (has_imu_ && time <= imu_time_) return;
  if (has_imu_ && to_seconds(time - imu_time_) > kGap_s) restart();
  if (has_imu_) {
    const double dt_s = true_per_host_second * to_seconds(time - imu_time_);
    integrate(measured, dt_s);
    block_sum_.omega_ib_b_radps += measured.omega_ib_b_radps;
    block_sum_.f_b_mps2 += measured.f_b_mps2;
    block_s_ += dt_s;
    ++block_samples_;
  }
  has_imu_ = true;
  imu_time_ = time;
  imu_ = measured;
  if (block_s_ >= kBlock_s) close_block();
  update_stage();
}

// N-42: attitude by the gyros, less what they showed at rest; velocity and position by trapezoids.
void InitialAligner::integrate(const InertialRates& end, double dt_s) noexcept {
  const Vector3d omega = 0.5 * (imu_.omega_ib_b_radps + end.omega_ib_b_radps) - rest_rate_b_radps_;
  C_b_a_ = reorthonormalized(C_b_a_ * exp_so3(omega * dt_s));
  const Vector3d a = C_b_a_ * end.f_b_mps2 + Vector3d(0.0, 0.0, gravity_mps2_);
  const Vector3d mean_a = 0.5 * (a_a_mps2_ + a);
  felt_a_m_ += dt_s * felt_velocity_a_mps_ + 0.5 * dt_s * dt_s * mean_a;
  felt_velocity_a_mps_ += dt_s * mean_a;
  a_a_mps2_ = a;
  levelled_s_ += dt_s;
}

void InitialAligner::close_block() noexcept {
  const double n = block_samples_;
  const InertialRates mean{block_sum_.omega_ib_b_radps / n, block_sum_.f_b_mps2 / n};
  const bool quiet = mean.omega_ib_b_radps.norm() < kRestRateMax_radps && imu_time_ > moving_until_;
  const bool same = (mean.omega_ib_b_radps - rest_mean_.omega_ib_b_radps).norm() < kRestRateChange_radps &&
                    (mean.f_b_mps2 - rest_mean_.f_b_mps2).norm() < kRestForceChange_mps2;
  if (!quiet) {
    rest_s_ = 0.0;
  } else if (rest_s_ > 0.0 && same) {
    rest_s_ = std::min(rest_s_ + block_s_, options_.gyrocompass_s_max);
    const double share = block_s_ / rest_s_;
    rest_mean_.omega_ib_b_radps += share * (mean.omega_ib_b_radps - rest_mean_.omega_ib_b_radps);
    rest_mean_.f_b_mps2 += share * (mean.f_b_mps2 - rest_mean_.f_b_mps2);
  } else {
    rest_mean_ = mean;
    rest_s_ = block_s_;
  }
  block_sum_ = {};
  block_s_ = 0.0;
  block_samples_ = 0;
  if (rest_s_ >= options_.rest_s && method_ != AlignmentMethod::kReferenceAttitude) level_and_gyrocompass();
}

void InitialAligner::level_and_gyrocompass() noexcept {
  const NavigationProcessNoise& noise = options_.reference_noise;
  const double sd_f = noise.accel_bias.sd + noise.accel_noise_mps2_per_sqrt_hz / std::sqrt(rest_s_);
  const double heading_in_a = level_ ? heading_of(C_b_a_) : 0.0;
  const InitialAttitude level = level_from_rest(rest_mean_.f_b_mps2, sd_f, heading_in_a);
  C_b_a_ = level.C_b_n;
  C_b_a_at_rest_ = C_b_a_;
  tilt_sd_rad_ = level.sd_n_rad.x();
  rest_rate_b_radps_ = rest_mean_.omega_ib_b_radps;
  rest_force_b_mps2_ = rest_mean_.f_b_mps2;
  rest_used_s_ = rest_s_;
  levelled_s_ = 0.0;
  tilt_error_a_rad_.setZero();
  if (!level_) {
    // What was integrated before had no meaning.
    node_count_ = 0;
    felt_velocity_a_mps_.setZero();
    felt_a_m_.setZero();
  }
  level_ = true;

  if (!has_origin_) return;
  const double sd_omega =
      std::hypot(noise.gyro_bias.sd,
                 std::hypot(noise.gyro_noise_radps_per_sqrt_hz / std::sqrt(rest_s_), kSway_rad / rest_s_));
  const InitialAttitude found =
      gyrocompass(rest_mean_.omega_ib_b_radps, rest_mean_.f_b_mps2, sd_omega, sd_f, origin_.latitude_rad);
  if (found.sd_n_rad.z() > options_.heading_sd_limit_rad) return;
  heading_of_a_rad_ = wrapped_angle(heading_of(found.C_b_n) - heading_in_a);
  heading_sd_rad_ = found.sd_n_rad.z();
  heading_known_ = true;
  method_ = AlignmentMethod::kGyrocompass;
}

void InitialAligner::add_attitude(HostTime time, const EulerAngles& attitude,
                                  const Vector3d& sd_rpy_rad) noexcept {
  if (!has_imu_ || std::abs(to_seconds(imu_time_ - time)) > kGap_s || !sd_rpy_rad.allFinite()) return;
  const Matrix3d C_b_n = rotation_from_euler(attitude);
  if (!C_b_n.allFinite()) return;
  // From now on frame a is NED, refreshed with every attitude and carried over its latency by the gyros.
  const Vector3d turned = imu_.omega_ib_b_radps * to_seconds(imu_time_ - time);
  C_b_a_ = C_b_n * exp_so3(turned);
  if (method_ != AlignmentMethod::kReferenceAttitude) {
    node_count_ = 0;
    felt_velocity_a_mps_.setZero();
    felt_a_m_.setZero();
    a_a_mps2_ = C_b_a_ * imu_.f_b_mps2 + Vector3d(0.0, 0.0, gravity_mps2_);
  }
  method_ = AlignmentMethod::kReferenceAttitude;
  level_ = true;
  levelled_s_ = 0.0;
  rest_rate_b_radps_.setZero();
  heading_known_ = true;
  heading_of_a_rad_ = 0.0;
  heading_sd_rad_ = sd_rpy_rad.z();
  tilt_sd_rad_ = std::max(sd_rpy_rad.x(), sd_rpy_rad.y());
  tilt_error_a_rad_.setZero();
  update_stage();
}

void InitialAligner::add_gnss_velocity(HostTime time, const Vector3d& v_n_mps,
                                       const Vector3d& sd_mps) noexcept {
  if (!has_imu_ || std::abs(to_seconds(imu_time_ - time)) > kGap_s) return;
  if (!v_n_mps.allFinite() || !sd_mps.allFinite()) return;
  has_velocity_ = true;
  velocity_time_ = time;
  v_antenna_n_mps_ = v_n_mps;
  v_sd_mps_ = sd_mps;
  const Vector3d swing_a = C_b_a_ * (imu_.omega_ib_b_radps - rest_rate_b_radps_).cross(options_.r_ba_b_m);
  felt_velocity_then_a_mps_ = felt_velocity_a_mps_ - a_a_mps2_ * to_seconds(imu_time_ - time) + swing_a;
}

void InitialAligner::add_gnss_position(HostTime time, const GeodeticPosition& antenna,
                                       const Vector3d& sd_m) noexcept {
  if (!has_imu_ || std::abs(to_seconds(imu_time_ - time)) > kGap_s) return;
  if (!std::isfinite(antenna.latitude_rad) || !std::isfinite(antenna.longitude_rad) ||
      !std::isfinite(antenna.height_m) || !sd_m.allFinite()) {
    return;
  }
  if (!has_origin_) {
    has_origin_ = true;
    origin_ = antenna;
    origin_time_ = time;
    gravity_mps2_ = normal_gravity(antenna.latitude_rad, antenna.height_m).g_mps2;
  }
  Node added;
  added.time_s = seconds(time);
  added.position_n_m = ned_offset(origin_, antenna);
  added.sd_m = sd_m.head<2>().norm() / std::sqrt(2.0);
  if (node_count_ > 0 && added.time_s - node(0).time_s < kNodeSpacing_s) return;
  // Back to the epoch: the newest acceleration and rate are good for the latency of a receiver.
  const double back_s = to_seconds(imu_time_ - time);
  const Vector3d omega = imu_.omega_ib_b_radps - rest_rate_b_radps_;
  added.felt_a_m = felt_a_m_ - back_s * felt_velocity_a_mps_ + 0.5 * back_s * back_s * a_a_mps2_ +
                   C_b_a_ * exp_so3(-back_s * omega) * options_.r_ba_b_m;
  note_gnss_motion(added);
  nodes_[node_count_ % kNodes] = added;
  ++node_count_;
  if (level_ && method_ == AlignmentMethod::kInMotion) find_heading_in_motion();
  update_stage();
}

void InitialAligner::note_gnss_motion(const Node& added) noexcept {
  if (node_count_ == 0) return;
  const double dt_s = added.time_s - node(0).time_s;
  const double moved_m = (added.position_n_m - node(0).position_n_m).head<2>().norm();
  if (moved_m > kGnssMotion_mps * dt_s + kGnssMotionSds * std::hypot(added.sd_m, node(0).sd_m)) {
    moving_until_ = imu_time_ + from_seconds(kGnssMotionHold_s);
    rest_s_ = 0.0;
  }
}

// N-43: windows of three nodes, three seconds apart.
void InitialAligner::find_heading_in_motion() noexcept {
  std::array<VelocityChange, kNodes> windows;
  std::size_t n = 0;
  const double now_s = seconds(imu_time_);
  const std::size_t held = nodes_held();
  std::size_t later = 0;
  std::size_t earlier = 0;
  double spacing_s = 0.0;
  for (std::size_t middle = 1; middle + 1 < held; ++middle) {
    const Node& m = node(middle);
    while (later + 1 < middle && node(later + 1).time_s - m.time_s >= kHalfWindow_s) ++later;
    earlier = std::max(earlier, middle + 1);
    while (earlier + 1 < held && m.time_s - node(earlier).time_s < kHalfWindow_s) ++earlier;
    const Node& a = node(earlier);
    const Node& b = node(later);
    const double first_s = m.time_s - a.time_s;
    const double second_s = b.time_s - m.time_s;
    if (first_s < kHalfWindow_s || second_s < kHalfWindow_s || first_s > kHalfWindowMax_s ||
        second_s > kHalfWindowMax_s) {
      continue;
    }
    const auto change = [&](const Vector3d& pa, const Vector3d& pm, const Vector3d& pb) {
      return ((pb - pm) / second_s - (pm - pa) / first_s).head<2>().eval();
    };
    VelocityChange& w = windows[n];
    w.felt_a_mps = change(a.felt_a_m, m.felt_a_m, b.felt_a_m);
    w.seen_n_mps = change(a.position_n_m, m.position_n_m, b.position_n_m);
    w.half_span_s = 0.5 * (first_s + second_s);
    w.age_s = now_s - m.time_s;
    w.sd_mps = std::sqrt(square(b.sd_m / second_s) + square(m.sd_m * (1.0 / second_s + 1.0 / first_s)) +
                         square(a.sd_m / first_s));
    if (n > 0) spacing_s += windows[n].age_s - windows[n - 1].age_s;
    ++n;
  }
  if (n < 2) return;
  spacing_s /= static_cast<double>(n - 1);

  const NavigationProcessNoise& noise = options_.reference_noise;
  HeadingPriors priors;
  // What rest left of the bias: noise of the mean, and the horizontal Earth rate that turns with the vehicle.
  priors.gyro_bias_sd_radps =
      std::max(kGyroBiasSdMin_radps,
               std::hypot(noise.gyro_noise_radps_per_sqrt_hz / std::sqrt(rest_used_s_), kEarthRate_radps));
  priors.acceleration_sd_mps2 = std::max(kAccelerationSdMin_mps2, tilt_sd_rad_ * gravity_mps2_);
  priors.window_overlap = std::max(1.0, kHalfWindow_s / spacing_s);
  HeadingSolution found;
  if (!solve_heading(std::span<const VelocityChange>(windows.data(), n), priors, found)) return;
  heading_sd_rad_ = std::min(kPi, found.sd_rad);
  heading_known_ = found.sd_rad < options_.heading_sd_limit_rad && found.scale > kScaleMin &&
                   found.scale < kScaleMax && found.weight_share > kWeightShareMin;
  heading_of_a_rad_ = found.heading_rad;
  // N-46: a tilt phi shows as the acceleration phi x (0, 0, -g).
  const Eigen::Vector2d& c = found.acceleration_error_a_mps2;
  tilt_error_a_rad_ = Vector3d(c.y(), -c.x(), 0.0) / gravity_mps2_;
}

void InitialAligner::update_stage() noexcept {
  stage_ = AlignmentStage::kDone;
  if (!level_) {
    stage_ = AlignmentStage::kWaitingForRest;
  } else if (!heading_known_) {
    stage_ = AlignmentStage::kWaitingForHeading;
  } else if (!find_position_and_velocity(result_)) {
    stage_ = AlignmentStage::kWaitingForPosition;
  }
  if (stage_ != AlignmentStage::kDone) return;

  result_.time = imu_time_;
  result_.method = method_;
  result_.state.C_b_n = C_a_n() * C_b_a_;
  result_.sd.segment<3>(kAttitudeError) = Vector3d(tilt_sd_rad_, tilt_sd_rad_, heading_sd_rad_);
  result_.rest = {};
  if (method_ == AlignmentMethod::kReferenceAttitude) return;

  result_.rest = {{rest_rate_b_radps_, rest_force_b_mps2_},
                  rest_used_s_,
                  levelled_s_,
                  C_a_n() * C_b_a_at_rest_,
                  kSway_rad / rest_used_s_};
}

// N-48: over the last seconds, antenna position less what was felt is a straight line.
bool InitialAligner::find_position_and_velocity(InitialNavigation& out) const noexcept {
  if (node_count_ == 0 || seconds(imu_time_) - node(0).time_s > kNewestNodeAgeMax_s) return false;
  const Matrix3d C = C_a_n();
  const double now_s = seconds(imu_time_);
  double n = 0.0;
  double st = 0.0;
  double stt = 0.0;
  double sd_m = 0.0;
  Vector3d sp = Vector3d::Zero();
  Vector3d stp = Vector3d::Zero();
  Vector3d spp = Vector3d::Zero();
  for (std::size_t i = 0; i < nodes_held() && now_s - node(i).time_s <= kFitSpan_s; ++i) {
    const double t = node(i).time_s - now_s;
    const Vector3d p = node(i).position_n_m - C * (node(i).felt_a_m - felt_a_m_);
    n += 1.0;
    st += t;
    stt += t * t;
    sp += p;
    stp += t * p;
    spp += p.cwiseProduct(p);
    sd_m = std::max(sd_m, node(i).sd_m);
  }
  const double tt = stt - st * st / n;
  const double span_s = now_s - node(static_cast<std::size_t>(n) - 1).time_s;
  if (n < 3.0 || span_s < kFitSpanMin_s) return false;
  const Vector3d tp = stp - st / n * sp;
  const Vector3d slope = tp / tt;
  const Vector3d at_now = sp / n - slope * (st / n);
  const Vector3d residual = (spp - sp.cwiseProduct(sp) / n - tp.cwiseProduct(tp) / tt).cwiseMax(0.0) / n;
  const double scatter_m = std::sqrt(residual.sum() / 3.0);
  if (scatter_m > kFitResidualMax_m + 3.0 * sd_m) return false;

  // Line and felt motion start at the same place now; the felt velocity is added to the slope.
  out.state.v_n_mps = slope + C * felt_velocity_a_mps_;
  out.state.position = displaced(origin_, at_now);
  const double point_m = std::max(scatter_m, sd_m);
  const double drag_mps2 = tilt_sd_rad_ * gravity_mps2_;
  out.sd.segment<3>(kPositionError)
      .setConstant(std::sqrt(square(point_m) * (1.0 / n + st * st / (n * n * tt)) + square(sd_m) +
                             square(drag_mps2 * span_s * span_s / 8.0)));
  out.sd.segment<3>(kVelocityError)
      .setConstant(
          std::sqrt(square(point_m) / tt + square(0.5 * drag_mps2 * span_s) + square(kVelocitySdMin_mps)));
  if (has_velocity_ && now_s - seconds(velocity_time_) < kVelocityAgeMax_s) take_gnss_velocity(out);
  return true;
}

void InitialAligner::take_gnss_velocity(InitialNavigation& out) const noexcept {
  out.state.v_n_mps = v_antenna_n_mps_ + C_a_n() * (felt_velocity_a_mps_ - felt_velocity_then_a_mps_);
  out.sd.segment<3>(kVelocityError) =
      (v_sd_mps_.array().square() + square(kVelocitySdMin_mps)).sqrt().matrix();
}

}  // namespace imuscope
