#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>

#include "base/units.h"
#include "check/bins.h"
#include "check/checks.h"

namespace imuscope::check {

namespace {

/// Leap seconds between GPS time and UTC since 2017-01-01 (IERS Bulletin C 52).
constexpr double kGpsMinusUtc_s = 18.0;
constexpr double kLagMax_s = 60.0;
/// A receiver's answer is late by some tenths of a second at most, where its stamps are those of arrival.
constexpr double kLagTolerance_s = 0.6;
/// So much of the curves must be explained before anything is said, ...
constexpr double kExplainedMin = 0.8;
/// ... and so much more than without the finding.
constexpr double kGainMin = 0.15;
/// Twenty seconds in motion.
constexpr std::size_t kMotionBinsMin = 200;
/// Across the course; less is made by positions that are good to some centimetres.
constexpr double kCurvesMin_mps2 = 0.05;
/// Of the first part of a drive: a time that is wrong is so from the beginning.
constexpr std::size_t kBinsMax = 9000;
/// Scale errors and body roll stay below this factor; a factor beyond it is a unit.
constexpr double kSlopeTolerance = 0.3;

/// Curves of which no more than this is explained at any time are of another drive: ...
constexpr double kForeignMax = 0.4;
/// ... where both sides have such as any bend makes, ...
constexpr double kForeignCurves_mps2 = 0.3;
/// ... and the positions show no more than that.
constexpr double kForeignScatter = 2.0;
/// A course that a vehicle takes, within ten metres about where it stood.
constexpr double kTurning_radps = 0.05;
constexpr double kTurned_rad = 1.0;
constexpr double kStands_m = 10.0;
/// Within 45 degrees.
constexpr double kAlong = 0.7;

/// Least squares of the acceleration across the course on the rates times the speed, at one lag.
struct Curves {
  double explained = 0.0;
  double rms_mps2 = 0.0;
  std::size_t n = 0;
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();
};

Curves curves_at(const GnssMotion& motion, const ImuBins& imu, std::int64_t lag) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double squares = 0.0;
  double sum = 0.0;
  Curves out;
  for (std::size_t k = 0; k < std::min(motion.valid.size(), kBinsMax); ++k) {
    const std::int64_t bin = motion.first + static_cast<std::int64_t>(k) + lag;
    if (!motion.valid[k] || !imu.has(bin)) continue;
    const Eigen::Vector3d omega = imu.omega_radps[imu.index(bin)];
    const Eigen::Vector4d x(motion.speed_mps[k] * omega.x(), motion.speed_mps[k] * omega.y(),
                            motion.speed_mps[k] * omega.z(), motion.speed_mps[k]);
    const double y = motion.right_mps2[k];
    normal += x * x.transpose();
    right += x * y;
    squares += y * y;
    sum += y;
    ++out.n;
  }
  if (out.n < kMotionBinsMin) return out;
  const auto n = static_cast<double>(out.n);
  const Eigen::Vector4d slope = normal.fullPivLu().solve(right);
  out.slope = slope.head<3>();
  out.rms_mps2 = std::sqrt(squares / n);
  const double total = squares - sum * sum / n;
  out.explained = total > 0.0 ? 1.0 - (squares - slope.dot(right)) / total : 0.0;
  return out;
}

/// The lag that fits best, in bins; what is to be added to the receiver's times.
struct Lag {
  std::int64_t bins = 0;
  Curves at_zero;
  Curves at_best;
};

Lag best_lag(const GnssMotion& motion, const ImuBins& imu) {
  Lag lag;
  lag.at_zero = curves_at(motion, imu, 0);
  lag.at_best = lag.at_zero;
  const auto most = static_cast<std::int64_t>(kLagMax_s / kBin_s);
  const std::size_t n_min = std::max(kMotionBinsMin, lag.at_zero.n / 2);
  for (std::int64_t bins = -most; bins <= most; ++bins) {
    const Curves curves = curves_at(motion, imu, bins);
    if (curves.n < n_min || curves.explained <= lag.at_best.explained) continue;
    lag.bins = bins;
    lag.at_best = curves;
  }
  return lag;
}

void report_lag(Drive& drive, std::size_t gnss, const Lag& lag, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[gnss];
  double shift_s = static_cast<double>(lag.bins) * kBin_s;
  Finding finding{Harm::kWrong, "time of positions", config.name, {}, shift_s, 0.0, "s", {}, {}};
  const bool gps = std::abs(std::abs(shift_s) - kGpsMinusUtc_s) < kLagTolerance_s;
  if (gps) shift_s = std::copysign(kGpsMinusUtc_s, shift_s);
  finding.what =
      fmt::format("its positions fit the motion {:.1f} s {}{}", std::abs(shift_s),
                  shift_s > 0.0 ? "later" : "earlier", gps ? " (GPS time is 18 s ahead of UTC)" : "");
  if (traits_of(config.protocol).is_text) {
    finding.remedy =
        fmt::format("write time_offset_s = {:.1f} in its [device.csv]", shift_s + config.csv.time_offset_s);
    finding.mends.push_back(
        {config.name, "csv.time_offset_s", fmt::format("{:.1f}", shift_s + config.csv.time_offset_s)});
  } else {
    finding.remedy = fmt::format("add {:.1f} s to its times", shift_s);
  }
  findings.push_back(std::move(finding));
  for (double& time : drive.gnss(gnss).time_s) time += shift_s;
}

/// Units of the reference's rates, by the course that they make.
void check_rate_unit(Drive& drive, const Curves& curves, std::vector<Finding>& findings) {
  const std::size_t reference = drive.configuration().reference_index();
  const DeviceConfig& config = drive.configuration().devices[reference];
  const double ratio = 1.0 / curves.slope.norm();  // of the gyros' turn to that of the course
  if (ratio < 1.0 + kSlopeTolerance && ratio > 1.0 / (1.0 + kSlopeTolerance)) return;
  Finding finding{Harm::kWrong, "rate unit", config.name, {}, ratio, 1.0, "times the turn of the course",
                  {},           {}};
  const bool increments = std::abs(ratio * config.rate_hz - 1.0) < kSlopeTolerance;
  const bool degrees = std::abs(ratio / kDegPerRad - 1.0) < kSlopeTolerance;
  const bool radians = std::abs(ratio * kDegPerRad - 1.0) < kSlopeTolerance;
  if (degrees || radians) {
    const char* unit = degrees ? "deg/s" : "rad/s";
    finding.what = fmt::format("its gyros are in {}, read as {}", unit, degrees ? "rad/s" : "deg/s");
    finding.remedy = fmt::format("write gyro_unit = \"{}\" in its [device.csv]", unit);
    if (traits_of(config.protocol).is_text)
      finding.mends.push_back({config.name, "csv.gyro_unit", fmt::format("\"{}\"", unit)});
    for (Eigen::Vector3f& omega : drive.imu(reference).omega_radps)
      omega *= static_cast<float>(degrees ? kRadPerDeg : kDegPerRad);
  } else if (increments) {
    finding.what = kIncrements;
    finding.remedy = divide_by_the_time_of_a_sample(config);
    for (Eigen::Vector3f& omega : drive.imu(reference).omega_radps)
      omega *= static_cast<float>(config.rate_hz);
  } else {
    finding.what = "its gyros do not turn as much as the course does";
    finding.remedy = "check gyro_unit, gyro_columns and the scale of its gyros";
  }
  findings.push_back(std::move(finding));
}

/// Forces across gravity against the acceleration over ground: z = gain w, or gain conj(w).
void find_forward(const GnssMotion& motion, const ImuBins& imu, ReferenceAxes& axes) {
  // The configured x axis (or y, where x is down) made level, and what lies to its right.
  Eigen::Vector3d level = Eigen::Vector3d::UnitX() - axes.down.x() * axes.down;
  constexpr double kLevelMin = 0.3;
  const bool by_y = level.norm() < kLevelMin;
  if (by_y) level = Eigen::Vector3d::UnitY() - axes.down.y() * axes.down;
  const Eigen::Vector3d ahead = level.normalized();
  const Eigen::Vector3d right = axes.down.cross(ahead);
  std::complex<double> zw = 0.0;
  std::complex<double> zc = 0.0;
  std::complex<double> z_sum = 0.0;
  std::complex<double> w_sum = 0.0;
  double zz = 0.0;
  double ww = 0.0;
  double n = 0.0;
  for (std::size_t k = 0; k < motion.valid.size(); ++k) {
    const std::int64_t bin = motion.first + static_cast<std::int64_t>(k);
    if (!motion.valid[k] || !imu.has(bin)) continue;
    const Eigen::Vector3d f = imu.f_mps2[imu.index(bin)];
    const std::complex<double> z(f.dot(ahead), f.dot(right));
    const std::complex<double> w(motion.forward_mps2[k], motion.right_mps2[k]);
    z_sum += z;
    w_sum += w;
    zw += z * std::conj(w);
    zc += z * w;
    zz += std::norm(z);
    ww += std::norm(w);
    n += 1.0;
  }
  if (n < static_cast<double>(kMotionBinsMin)) return;
  zw -= z_sum * std::conj(w_sum) / n;
  zc -= z_sum * w_sum / n;
  zz -= std::norm(z_sum) / n;
  ww -= std::norm(w_sum) / n;
  if (!(ww > kCurvesMin_mps2 * kCurvesMin_mps2 * n) || !(zz > 0.0)) return;
  const double straight = std::norm(zw) / (zz * ww);
  const double mirrored = std::norm(zc) / (zz * ww);
  constexpr double kCoherenceMin = 0.4;
  // Braking alone shows where forward is, and nothing of the hand: both fit alike then.
  constexpr double kLead = 1.5;
  if (std::max(straight, mirrored) < kCoherenceMin) return;
  axes.has_forward = true;
  axes.mirrored = mirrored > kLead * straight;
  axes.forward_rad = std::arg(axes.mirrored ? zc : zw);
  axes.ahead = ahead;
  axes.right = right;
}

/// The acceleration across the course that the reference's turning makes at the speed of the positions.
struct Turns {
  double turn_mps2 = 0.0;  ///< rms
  double n = 0.0;
};

Turns turns_of(const GnssMotion& motion, const ImuBins& imu, const Eigen::Vector3d& down) {
  Turns turns;
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t k = 0; k < motion.valid.size(); ++k) {
    const std::int64_t bin = motion.first + static_cast<std::int64_t>(k);
    if (!motion.valid[k] || !imu.has(bin)) continue;
    const double turn = motion.speed_mps[k] * imu.omega_radps[imu.index(bin)].dot(down);
    sum += turn;
    squares += turn * turn;
    turns.n += 1.0;
  }
  if (turns.n > 0.0)
    turns.turn_mps2 = std::sqrt(std::max(squares / turns.n - sum * sum / (turns.n * turns.n), 0.0));
  return turns;
}

/// Curves on both sides, and at no time the same ones.
void check_same_drive(const Drive& drive, std::size_t gnss, const Curves& curves, const Turns& turns,
                      std::vector<Finding>& findings) {
  if (curves.explained > kForeignMax || turns.n < static_cast<double>(kMotionBinsMin)) return;
  if (turns.turn_mps2 < kForeignCurves_mps2 || curves.rms_mps2 < kForeignCurves_mps2) return;
  // Where the scatter of positions is the larger part of what they show, nothing can be said.
  if (curves.rms_mps2 > kForeignScatter * turns.turn_mps2) return;
  const DeviceConfig& config = drive.configuration().devices[gnss];
  findings.push_back(
      {Harm::kWrong,
       "other drive",
       config.name,
       fmt::format("its positions do not turn as {} does, at any time within {:g} s",
                   drive.configuration().devices[drive.configuration().reference_index()].name, kLagMax_s),
       100.0 * curves.explained,
       0.0,
       "% of its curves explained",
       "give the positions of this drive, and check which columns are latitude and longitude",
       {}});
}

/// Positions within a few metres while the reference turns as a vehicle does on its way.
void check_standing(const Drive& drive, std::size_t gnss, const ImuBins& imu, const Eigen::Vector3d& down,
                    std::vector<Finding>& findings) {
  const GnssTrack& track = drive.gnss(gnss);
  if (track.size() < kMotionBinsMin / 2) return;
  double farthest_m = 0.0;
  for (const Eigen::Vector2d& position : track.position_m) farthest_m = std::max(farthest_m, position.norm());
  double turned_rad = 0.0;
  for (std::size_t i = 0; i < imu.valid.size(); ++i) {
    const double rate = std::abs(imu.omega_radps[i].dot(down));
    if (imu.valid[i] && rate > kTurning_radps) turned_rad += rate * kBin_s;
  }
  // Around the origin of both there is nothing but sea.
  const bool as_radians = std::abs(track.first.latitude_rad) < 0.5 * kPi * kRadPerDeg &&
                          std::abs(track.first.longitude_rad) < kPi * kRadPerDeg;
  if (!as_radians && (farthest_m > kStands_m || turned_rad < kTurned_rad)) return;
  const DeviceConfig& config = drive.configuration().devices[gnss];
  Finding finding{Harm::kWrong,
                  "standing positions",
                  config.name,
                  "its positions stand while the reference turns",
                  turned_rad,
                  0.0,
                  "rad of turns",
                  "check latitude_column and longitude_column, and their unit: degrees are wanted",
                  {}};
  if (as_radians) {
    finding.what = "its latitude and longitude are in radians, read as degrees: it hardly moves";
    finding.remedy = "convert them to degrees where they are written";
  }
  findings.push_back(std::move(finding));
}

/// Whether the forces of the reference agree with its own rates: turning about what is down, it is pushed to the
/// right of where braking shows forward to be. The map has no part in it, but for the speed.
bool turns_by_itself(const GnssMotion& motion, const ImuBins& imu, const Eigen::Vector3d& down) {
  std::vector<Eigen::Vector3d> forces;
  std::vector<Eigen::Vector2d> moves;  // along the course, and the speed times the turn
  Eigen::Vector3d mean_f = Eigen::Vector3d::Zero();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < motion.valid.size(); ++k) {
    const std::int64_t bin = motion.first + static_cast<std::int64_t>(k);
    if (!motion.valid[k] || !imu.has(bin)) continue;
    const std::size_t i = imu.index(bin);
    forces.push_back(imu.f_mps2[i]);
    moves.emplace_back(motion.forward_mps2[k], motion.speed_mps[k] * imu.omega_radps[i].dot(down));
    mean_f += forces.back();
    mean += moves.back();
  }
  if (forces.size() < kMotionBinsMin) return false;
  mean_f /= static_cast<double>(forces.size());
  mean /= static_cast<double>(forces.size());
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Matrix<double, 3, 2> product = Eigen::Matrix<double, 3, 2>::Zero();
  for (std::size_t i = 0; i < forces.size(); ++i) {
    const Eigen::Vector2d move = moves[i] - mean;
    normal += move * move.transpose();
    product += (forces[i] - mean_f) * move.transpose();
  }
  if (!(normal.determinant() > 0.0)) return false;
  const Eigen::Matrix<double, 3, 2> gain = product * normal.inverse();
  const Eigen::Vector3d forward = gain.col(0) - gain.col(0).dot(down) * down;
  // Both are 1 where all is well: what is pushed is the body.
  constexpr double kGainMost = 2.0;
  const double across = gain.col(1).dot(down.cross(forward.normalized()));
  return forward.norm() > 1.0 / kGainMost && forward.norm() < kGainMost && across > 1.0 / kGainMost &&
         across < kGainMost;
}

void report_mirrored(const DeviceConfig& config, std::vector<Finding>& findings) {
  findings.push_back(
      {Harm::kWrong,
       "mirrored map",
       config.name,
       "its positions turn left where the vehicle turns right",
       0.0,
       0.0,
       {},
       "latitude and longitude are exchanged, or one has the wrong sign (north and east are positive): "
       "check latitude_column and longitude_column",
       {}});
}

}  // namespace

ReferenceAxes check_motion(Drive& drive, std::size_t gnss, std::vector<Finding>& findings) {
  ReferenceAxes axes = reference_down(drive);
  const std::size_t reference = drive.configuration().reference_index();
  GnssMotion motion = motion_of(drive.gnss(gnss));
  const int width = 2 * static_cast<int>(motion.half_window_s / (2.0 * kBin_s)) + 1;
  const ImuBins imu = bins_of(drive.imu(reference), width);
  const Lag lag = best_lag(motion, imu);
  Curves curves = lag.at_best;
  check_standing(drive, gnss, imu, axes.down, findings);
  if (curves.n < kMotionBinsMin || curves.rms_mps2 < kCurvesMin_mps2) return axes;
  if (curves.explained < kExplainedMin) {
    check_same_drive(drive, gnss, curves, turns_of(motion, imu, axes.down), findings);
    return axes;
  }
  if (std::abs(static_cast<double>(lag.bins)) * kBin_s > kLagTolerance_s &&
      curves.explained > lag.at_zero.explained + kGainMin) {
    report_lag(drive, gnss, lag, findings);
  }
  check_rate_unit(drive, curves, findings);
  motion.first += lag.bins;
  if (axes.down.z() > kAlong && curves.slope.normalized().dot(axes.down) < -kAlong &&
      turns_by_itself(motion, imu, axes.down)) {
    report_mirrored(drive.configuration().devices[gnss], findings);
    for (double& right : motion.right_mps2) right = -right;
    curves.slope = -curves.slope;
  }
  axes.has_course = true;
  axes.gyro_down = curves.slope.normalized();
  find_forward(motion, imu, axes);
  return axes;
}

}  // namespace imuscope::check
