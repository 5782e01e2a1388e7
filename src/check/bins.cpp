#include "check/bins.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace imuscope::check {

namespace {

/// A degree a second: an offset of less hides no motion that two sensors are compared by.
constexpr float kPlainOffset_radps = 0.0175F;
/// Below a walk a course is mostly noise of the positions.
constexpr double kCourseSpeedMin_mps = 2.0;
/// Of the parabola: a second each side, or what holds five positions.
constexpr double kHalfWindow_s = 1.0;
constexpr double kHalfWindowPeriods = 2.5;
constexpr std::size_t kPositionsMin = 4;

std::int64_t bin_of(double time_s) { return static_cast<std::int64_t>(std::floor(time_s / kBin_s)); }

void smooth(ImuBins& bins, int width) {
  const ImuBins raw = bins;
  const auto n = static_cast<std::int64_t>(raw.valid.size());
  const std::int64_t half = width / 2;
  for (std::int64_t i = 0; i < n; ++i) {
    Eigen::Vector3d omega = Eigen::Vector3d::Zero();
    Eigen::Vector3d f = Eigen::Vector3d::Zero();
    bool valid = i >= half && i + half < n;
    for (std::int64_t k = i - half; k <= i + half && valid; ++k) {
      const auto at = static_cast<std::size_t>(k);
      valid = raw.valid[at];
      omega += raw.omega_radps[at];
      f += raw.f_mps2[at];
    }
    const auto at = static_cast<std::size_t>(i);
    bins.valid[at] = valid;
    bins.omega_radps[at] = omega / width;
    bins.f_mps2[at] = f / width;
  }
}

double median_step(const std::vector<double>& time_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time_s.size(); ++i) steps.push_back(time_s[i] - time_s[i - 1]);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

}  // namespace

Eigen::Vector3f usual_rate(const ImuTrack& track) {
  Eigen::Vector3f usual;
  std::vector<float> values(track.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::transform(track.omega_radps.begin(), track.omega_radps.end(), values.begin(),
                   [axis](const Eigen::Vector3f& omega) { return omega[axis]; });
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    usual[axis] = *middle;
  }
  return usual;
}

Eigen::Vector3f plain_offset(const ImuTrack& track) {
  const Eigen::Vector3f usual = usual_rate(track);
  return usual.norm() > kPlainOffset_radps ? usual : Eigen::Vector3f::Zero();
}

ImuBins bins_of(const ImuTrack& track, int width) {
  ImuBins bins;
  if (track.size() == 0) return bins;
  bins.first = bin_of(track.time_s.front());
  const double last_s = std::min(track.time_s.back(), track.time_s.front() + kLongest_s);
  const auto n = static_cast<std::size_t>(std::max<std::int64_t>(bin_of(last_s) - bins.first + 1, 1));
  bins.omega_radps.assign(n, Eigen::Vector3d::Zero());
  bins.f_mps2.assign(n, Eigen::Vector3d::Zero());
  bins.valid.assign(n, false);
  std::vector<int> count(n, 0);
  for (std::size_t i = 0; i < track.size(); ++i) {
    const std::int64_t bin = bin_of(track.time_s[i]) - bins.first;
    if (bin < 0 || bin >= static_cast<std::int64_t>(n)) continue;
    const auto at = static_cast<std::size_t>(bin);
    bins.omega_radps[at] += track.omega_radps[i].cast<double>();
    bins.f_mps2[at] += track.f_mps2[i].cast<double>();
    ++count[at];
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (count[i] == 0) continue;
    bins.omega_radps[i] /= count[i];
    bins.f_mps2[i] /= count[i];
    bins.valid[i] = true;
  }
  if (width > 1) smooth(bins, width);
  return bins;
}

GnssMotion motion_of(const GnssTrack& track) {
  GnssMotion motion;
  if (track.size() < kPositionsMin) return motion;
  const double period_s = median_step(track.time_s);
  motion.half_window_s = std::max(kHalfWindow_s, kHalfWindowPeriods * period_s);
  motion.first = bin_of(track.time_s.front());
  const double last_s = std::min(track.time_s.back(), track.time_s.front() + kLongest_s);
  const auto n = static_cast<std::size_t>(std::max<std::int64_t>(bin_of(last_s) - motion.first + 1, 1));
  motion.speed_mps.assign(n, 0.0);
  motion.forward_mps2.assign(n, 0.0);
  motion.right_mps2.assign(n, 0.0);
  motion.valid.assign(n, false);
  std::size_t begin = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double centre_s = (static_cast<double>(motion.first) + static_cast<double>(k) + 0.5) * kBin_s;
    while (begin < track.size() && track.time_s[begin] < centre_s - motion.half_window_s) ++begin;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
    std::size_t count = 0;
    double before_s = 0.0;
    double after_s = 0.0;
    for (std::size_t i = begin; i < track.size() && track.time_s[i] <= centre_s + motion.half_window_s; ++i) {
      const double t = track.time_s[i] - centre_s;
      const Eigen::Vector3d row(1.0, t, 0.5 * t * t);
      normal += row * row.transpose();
      right += row * track.position_m[i].transpose();
      before_s = std::min(before_s, t);
      after_s = std::max(after_s, t);
      ++count;
    }
    const double wanted_s = 0.5 * motion.half_window_s;
    if (count < kPositionsMin || -before_s < wanted_s || after_s < wanted_s) continue;
    const Eigen::Matrix<double, 3, 2> fit = normal.fullPivLu().solve(right);
    const Eigen::Vector2d v = fit.row(1).transpose();
    const Eigen::Vector2d a = fit.row(2).transpose();
    motion.speed_mps[k] = v.norm();
    if (motion.speed_mps[k] < kCourseSpeedMin_mps) continue;
    motion.forward_mps2[k] = v.dot(a) / motion.speed_mps[k];
    motion.right_mps2[k] = (v.x() * a.y() - v.y() * a.x()) / motion.speed_mps[k];
    motion.valid[k] = true;
  }
  return motion;
}

}  // namespace imuscope::check
