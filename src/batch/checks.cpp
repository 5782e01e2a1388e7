#include "batch/checks.h"

#include <fmt/format.h>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "alignment/cross_correlation.h"
#include "base/units.h"
#include "batch/grid.h"

namespace imuscope::batch {

namespace {

constexpr double kShortestRecord_s = 20.0;
/// Scale errors stay within a few per cent; a factor beyond this is a unit.
constexpr double kRatioMax = 1.5;
/// Before the two are brought together: no noise makes such a difference of what moves.
constexpr double kUnitRatio = 20.0;
constexpr double kUnitTolerance = 0.3;
/// |omega| that varies by this (half a degree a second) is motion.
constexpr double kMotionMin_radps = 0.01;
/// Below this the two do not turn alike; the worst real pair on one vehicle has 0.98.
constexpr double kCorrelationMin = 0.7;
/// A mirrored triad fits better than any rotation by at least this share of the rates' power.
constexpr double kMirrorShareMin = 0.02;
/// No two sensors agree to a millionth.
constexpr double kCopyShare = 1e-6;
/// Beyond the kernel's reach on both sides.
constexpr double kMargin_s = 2.0 * kKernelHalf_s;

RateMagnitudeSeries magnitudes(const ImuRecord& record, std::vector<double>& storage) {
  storage.resize(record.size());
  for (std::size_t i = 0; i < record.size(); ++i)
    storage[i] = static_cast<double>(record.omega_radps[i].norm());
  return {record.time_s, storage};
}

/// Too little to tell.
Error unknown(std::string what, std::string remedy) {
  return Error{ErrorKind::kWork, std::move(what), std::move(remedy)};
}

/// Told, and it is wrong.
Error wrong(std::string what, std::string remedy) {
  return Error{ErrorKind::kUsage, std::move(what), std::move(remedy)};
}

/// sd of |omega| over a record.
double spread(const std::vector<double>& magnitudes) {
  double sum = 0.0;
  double squares = 0.0;
  for (const double value : magnitudes) {
    sum += value;
    squares += value * value;
  }
  const auto n = static_cast<double>(magnitudes.size());
  return std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
}

Error wrong_size(double ratio) {
  const bool degrees = std::abs(ratio / kDegPerRad - 1.0) < kUnitTolerance ||
                       std::abs(ratio * kDegPerRad - 1.0) < kUnitTolerance;
  return wrong(fmt::format("its angular rates are {:.3g} times the reference's", ratio),
               degrees ? "one of the two is in deg/s and read as rad/s: correct gyro_unit"
                       : "check gyro_unit and the columns of gyro and accelerometer");
}

/// Second moments of the two rates about their means.
struct RateMoments {
  Eigen::Matrix3d study_reference = Eigen::Matrix3d::Zero();
  double reference = 0.0;
  double study = 0.0;
};

RateMoments rate_moments(const Grid& reference, const Grid& study) {
  Eigen::Index n = 0;
  Eigen::Vector3d mean_r = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_s = Eigen::Vector3d::Zero();
  RateMoments m;
  for (int pass = 0; pass < 2; ++pass) {
    for (Eigen::Index i = 0; i < reference.motion.rows(); ++i) {
      if (reference.valid[static_cast<std::size_t>(i)] == 0 || study.valid[static_cast<std::size_t>(i)] == 0)
        continue;
      const Eigen::Vector3d r = reference.motion.row(i).head<3>().transpose();
      const Eigen::Vector3d s = study.motion.row(i).head<3>().transpose();
      if (pass == 0) {
        ++n;
        mean_r += r;
        mean_s += s;
        continue;
      }
      m.study_reference += (s - mean_s) * (r - mean_r).transpose();
      m.reference += (r - mean_r).squaredNorm();
      m.study += (s - mean_s).squaredNorm();
    }
    if (pass == 0 && n > 0) {
      mean_r /= static_cast<double>(n);
      mean_s /= static_cast<double>(n);
    }
  }
  return m;
}

Result<Start> rotation_of(const RateMoments& m, Start start) {
  const double ratio = std::sqrt(m.study / m.reference);
  if (!(ratio < kRatioMax) || !(ratio > 1.0 / kRatioMax)) return tl::unexpected(wrong_size(ratio));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m.study_reference, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double handedness = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  // B-18: with a reflection allowed the smallest singular value counts for, not against.
  const double mirror_gain = handedness < 0.0 ? 2.0 * svd.singularValues()[2] : 0.0;
  const double size = std::sqrt(m.study * m.reference);
  if (mirror_gain > kMirrorShareMin * size && mirror_gain > 0.2 * svd.singularValues().sum()) {
    return tl::unexpected(wrong("its rates are a mirror image of the reference's",
                                "one axis has the wrong sign, or two are swapped: correct axes"));
  }
  const Eigen::Vector3d signs(1.0, 1.0, handedness < 0.0 ? -1.0 : 1.0);
  start.C_b_s = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  start.rate_correlation = svd.singularValues().dot(signs) / size;
  if (start.rate_correlation < kCorrelationMin) {
    return tl::unexpected(wrong(
        fmt::format("its angular rates resemble the reference's by {:.2f} only (at least {:.1f} is needed)",
                    start.rate_correlation, kCorrelationMin),
        "both IMUs must sit on one rigid body and turn: check the mounting, the times and gyro_columns"));
  }
  if (1.0 - start.rate_correlation < kCopyShare && std::abs(ratio - 1.0) < kCopyShare)
    return tl::unexpected(wrong("it is a copy of the reference's data", "give the S-IMU's own file"));
  return start;
}

}  // namespace

std::vector<double> common_instants(const ImuRecord& reference, const ImuRecord& study, double time_offset_s,
                                    double rate_hz) {
  const double first = std::max(reference.time_s.front(), study.time_s.front() + time_offset_s) + kMargin_s;
  const double last = std::min(reference.time_s.back(), study.time_s.back() + time_offset_s) - kMargin_s;
  std::vector<double> instants;
  if (!(last > first)) return instants;
  const auto n = static_cast<std::size_t>((last - first) * rate_hz);
  instants.reserve(n);
  for (std::size_t i = 0; i < n; ++i) instants.push_back(first + static_cast<double>(i) / rate_hz);
  return instants;
}

Result<Start> find_start(const ImuRecord& reference, const ImuRecord& study, double search_s) {
  if (reference.size() < 3 || study.size() < 3)
    return tl::unexpected(unknown("there are too few samples", "record at least a minute of driving"));
  std::vector<double> reference_rates;
  std::vector<double> study_rates;
  TimeOffsetOptions options;
  options.search_s = search_s;
  const auto of_reference = magnitudes(reference, reference_rates);
  const auto of_study = magnitudes(study, study_rates);
  const double ratio = spread(study_rates) / spread(reference_rates);
  const bool moves = std::max(spread(study_rates), spread(reference_rates)) > kMotionMin_radps;
  if (moves && (ratio > kUnitRatio || ratio < 1.0 / kUnitRatio)) return tl::unexpected(wrong_size(ratio));
  const auto offset = find_time_offset(of_reference, of_study, options);
  if (!offset) return tl::unexpected<Error>(offset.error());
  Start start;
  start.time_offset_s = offset->offset_s;
  const auto instants = common_instants(reference, study, start.time_offset_s, kGridRate_hz);
  if (static_cast<double>(instants.size()) < kShortestRecord_s * kGridRate_hz) {
    return tl::unexpected(unknown(fmt::format("it shares {:.0f} s with the reference",
                                              static_cast<double>(instants.size()) / kGridRate_hz),
                                  fmt::format("at least {:.0f} s of driving are needed", kShortestRecord_s)));
  }
  std::vector<double> own = instants;
  for (double& time : own) time -= start.time_offset_s;
  return rotation_of(rate_moments(make_grid(reference, instants, false), make_grid(study, own, false)),
                     start);
}

}  // namespace imuscope::batch
