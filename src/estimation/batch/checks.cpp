#include "estimation/batch/checks.h"

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/units.h"
#include "estimation/alignment/cross_correlation.h"
#include "estimation/batch/grid.h"
#include "estimation/batch/pair_moments.h"

namespace imuscope::batch {

namespace {

/// Nobody turns, brakes and accelerates enough in less.
constexpr double kShortestRecord_s = 40.0;
/// Scale errors stay within a few per cent; a factor beyond this is a unit.
constexpr double kRatioMax = 1.5;
/// Before the two are brought together: no noise makes such a difference of what moves.
constexpr double kUnitRatio = 20.0;
constexpr double kUnitTolerance = 0.3;
/// |omega| that varies by this (half a degree a second) is motion.
constexpr double kMotionMin_radps = 0.01;
/// Over so long |omega| and forces are averaged before they are looked at: white noise is less than motion then.
constexpr double kAveraged_s = 0.5;
/// Below this the two do not turn alike; the worst real pair on one vehicle has 0.98.
constexpr double kCorrelationMin = 0.7;
/// No two sensors agree to a millionth.
constexpr double kCopyShare = 1e-6;
/// What a vehicle's accelerometers show in the mean is gravity: a third of it is no bias any more.
constexpr double kGravityTolerance = 1.0 / 3.0;
/// Of the forces of an upright body in g, half-second means are this near to one; of one that lies or accelerates, most.
constexpr double kGravityInG = 0.1;
/// Mean forces further apart than this, in g, are no biases: a third is gravity of 20 degrees.
constexpr double kMeanForceGapMax_g = 0.35;
/// A direction in which the two agree by this at some rotation has something to say.
constexpr double kSaysSomething = 0.5;
/// It loses less than this to noise, biases and a lever arm at the rotation that suits all.
constexpr double kLostAtMost = 0.3;
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

/// Calls f(first sample, how many) for every kAveraged_s; a shorter record is one piece.
template <typename Function>
void for_each_piece(const ImuRecord& record, Function f) {
  const auto piece = std::clamp<std::size_t>(static_cast<std::size_t>(kAveraged_s / sample_period_s(record)),
                                             1, record.size());
  for (std::size_t first = 0; first + piece <= record.size(); first += piece) f(first, piece);
}

/// sd of |omega|, averaged over kAveraged_s.
double spread(const ImuRecord& record, const std::vector<double>& magnitudes) {
  double sum = 0.0;
  double squares = 0.0;
  double n = 0.0;
  for_each_piece(record, [&](std::size_t first, std::size_t piece) {
    double value = 0.0;
    for (std::size_t i = first; i < first + piece; ++i) value += magnitudes[i] / static_cast<double>(piece);
    sum += value;
    squares += value * value;
    n += 1.0;
  });
  return n > 0.0 ? std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n))) : 0.0;
}

Error wrong_size(double ratio) {
  const bool degrees = std::abs(ratio / kDegPerRad - 1.0) < kUnitTolerance ||
                       std::abs(ratio * kDegPerRad - 1.0) < kUnitTolerance;
  return wrong(fmt::format("its angular rates are {:.3g} times the reference's", ratio),
               degrees ? "one of the two is in deg/s and read as rad/s: correct gyro_unit"
                       : "check gyro_unit and the columns of gyro and accelerometer");
}

const char* axis_name(Eigen::Index axis) {
  constexpr std::array<const char*, 6> kNames{"gyro x",          "gyro y",          "gyro z",
                                              "accelerometer x", "accelerometer y", "accelerometer z"};
  return kNames[static_cast<std::size_t>(axis)];
}

/// An axis that shows one number throughout is not connected, or its column is another's.
Result<void> nothing_is_stuck(const ImuRecord& record, const char* whose) {
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    const auto value = [&](std::size_t i) {
      return axis < 3 ? record.omega_radps[i][axis] : record.f_mps2[i][axis - 3];
    };
    bool moves = false;
    for (std::size_t i = 1; i < record.size() && !moves; ++i) moves = value(i) != value(0);
    if (!moves)
      return tl::unexpected(
          wrong(fmt::format("{} {} shows {:.4g} throughout", whose, axis_name(axis), value(0)),
                "check its columns and its axes"));
  }
  return {};
}

/// Sizes of the forces, averaged over kAveraged_s: gravity's, however the body lies, but for what accelerates it.
std::vector<double> slow_forces_mps2(const ImuRecord& record) {
  std::vector<double> sizes;
  for_each_piece(record, [&](std::size_t first, std::size_t n) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = first; i < first + n; ++i) sum += record.f_mps2[i].cast<double>();
    sizes.push_back(sum.norm() / static_cast<double>(n));
  });
  return sizes;
}

/// In the mean a vehicle's accelerometers show gravity.
Result<void> shows_gravity(const ImuRecord& record, const char* whose) {
  const std::vector<double> sizes = slow_forces_mps2(record);
  const auto n = static_cast<double>(sizes.size());
  const double mean_mps2 = std::accumulate(sizes.begin(), sizes.end(), 0.0) / n;
  if (std::abs(mean_mps2 / kMps2PerG - 1.0) < kGravityTolerance) return {};
  const auto ones = std::ranges::count_if(sizes, [](double f) { return std::abs(f - 1.0) < kGravityInG; });
  return tl::unexpected(
      wrong(fmt::format("{} forces are {:.3g} m/s^2 in the mean, which should be gravity", whose, mean_mps2),
            static_cast<double>(ones) > 0.5 * n
                ? "they are in g and read as m/s^2: correct accel_unit"
                : "check accel_unit and accel_columns; forces without gravity are of no use here"));
}

/// The rates: their size, handedness, likeness.
Result<void> rates_agree(const TriadMoments& rates) {
  const double ratio = rates.size_ratio();
  if (!(ratio < kRatioMax) || !(ratio > 1.0 / kRatioMax)) return tl::unexpected(wrong_size(ratio));
  if (rates.mirrored() > kSaysSomething) {
    return tl::unexpected(wrong("its rates are a mirror image of the reference's",
                                "one axis has the wrong sign, or two are swapped: correct axes"));
  }
  const double correlation = rates.correlation_at(rates.best_rotation());
  if (correlation < kCorrelationMin) {
    return tl::unexpected(wrong(
        fmt::format("its angular rates resemble the reference's by {:.2f} only (at least {:.1f} is needed)",
                    correlation, kCorrelationMin),
        "both IMUs must sit on one rigid body and turn: check the mounting, the times and gyro_columns"));
  }
  if (1.0 - correlation < kCopyShare && std::abs(ratio - 1.0) < kCopyShare)
    return tl::unexpected(wrong("it is a copy of the reference's data", "give the S-IMU's own file"));
  return {};
}

/// B-18a: one rotation must suit rates and forces, in every direction that has something to say.
Result<void> triads_agree(const PairMoments& moments, const Eigen::Matrix3d& C_b_s) {
  if (moments.forces_with_gravity.mirrored() > kSaysSomething) {
    return tl::unexpected(wrong(
        "its forces are a mirror image of the reference's",
        "an accelerometer has the wrong sign, two are swapped, or forces are upside down (at rest, with z "
        "down, it shows -9.8): correct axes and accel_columns"));
  }
  const double gap_g = moments.mean_force_gap_mps2(C_b_s) / kMps2PerG;
  const double lost = std::max(moments.rates.most_lost(C_b_s, kSaysSomething),
                               moments.forces.most_lost(C_b_s, kSaysSomething));
  if (gap_g < kMeanForceGapMax_g && lost < kLostAtMost) return {};
  const Eigen::AngleAxisd between(moments.forces_with_gravity.best_rotation() *
                                  moments.rates.best_rotation().transpose());
  return tl::unexpected(wrong(
      fmt::format("its forces and its rates do not go together: against the reference's they show "
                  "mountings that are {:.0f} deg apart",
                  between.angle() * kDegPerRad),
      "accelerometers and gyros of one IMU must have the same axes: check gyro_columns, accel_columns and "
      "axes of both IMUs"));
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
  for (const auto& check : {nothing_is_stuck, shows_gravity}) {
    if (auto ok = check(reference, "the reference's"); !ok) return tl::unexpected(ok.error());
    if (auto ok = check(study, "its"); !ok) return tl::unexpected(ok.error());
  }
  std::vector<double> reference_rates;
  std::vector<double> study_rates;
  TimeOffsetOptions options;
  options.search_s = search_s;
  const auto of_reference = magnitudes(reference, reference_rates);
  const auto of_study = magnitudes(study, study_rates);
  const double reference_spread = spread(reference, reference_rates);
  const double study_spread = spread(study, study_rates);
  const double ratio = study_spread / reference_spread;
  const bool moves = std::max(study_spread, reference_spread) > kMotionMin_radps;
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
  const PairMoments moments(make_grid(reference, instants, false), make_grid(study, own, false));
  if (auto ok = rates_agree(moments.rates); !ok) return tl::unexpected(ok.error());
  start.C_b_s = moments.common_rotation();
  start.rate_correlation = moments.rates.correlation_at(start.C_b_s);
  if (auto ok = triads_agree(moments, start.C_b_s); !ok) return tl::unexpected(ok.error());
  return start;
}

}  // namespace imuscope::batch
