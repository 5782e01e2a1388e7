#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/units.h"
#include "check/bins.h"
#include "check/checks.h"
#include "check/signed_axes.h"
#include "estimation/alignment/cross_correlation.h"

namespace imuscope::check {

namespace {

/// |omega| that varies by a degree a second: the vehicle turns.
constexpr double kMotionMin_radps = 0.0175;
/// Scale errors stay within a few per cent; noise may add to what moves little.
constexpr double kRatioMax = 1.6;
constexpr double kRateUnitTolerance = 0.35;
/// Below this they do not turn alike: a degree a second of motion against white noise of half a degree a
/// second a sample, of which 50 are in a mean, correlates by 0.99; recorded pairs do.
constexpr double kCorrelationMin = 0.9;
/// No two sensors give the same six numbers but where all are quantised beyond their noise.
constexpr double kCopyShare = 0.9;
constexpr std::size_t kCopySamples = 2000;
/// What the live estimator searches for by itself (estimation/alignment/cross_correlation.h, LiveTimeOffset) is 2 s.
constexpr double kSharedOffsetMax_s = 1.5;
/// Quartz is good to 100 ppm over temperature; three times that is no quartz, or another unit of time.
constexpr double kClockRateMax = 300e-6;
/// A clock that runs wrong blurs what its rate is found from: it is found again with the first answer.
constexpr int kClockRounds = 3;
constexpr double kSearch_s = 60.0;
constexpr std::size_t kPairBinsMin = 200;
/// Half a second: what vibration makes of two places is gone, the motion stays.
constexpr int kPairMeanBins = 5;
/// A naming of the axes is only believed where all others leave so much more of the motion unexplained.
constexpr double kCostFactor = 1.5;
/// Of two namings that explain the same, the simpler one.
constexpr double kPerAxis = 0.01;
/// Without this (m/s2, rms, of a direction that is not gravity's) forces do not tell handedness.
constexpr double kForcesMin_mps2 = 0.15;

/// The largest offset of consumer accelerometers, nearly (0.08 g, data sheet of the MPU-6050, z).
constexpr double kAccelOffsetMax_mps2 = 1.0;
/// More is gravity: a sign, or an axis.
constexpr double kAccelOffsetMost_mps2 = 4.0;
/// Three degrees of gravity: no body of a vehicle bends so far, no accelerometer drifts so far.
constexpr double kMovedMin_mps2 = 0.5;
constexpr std::size_t kParts = 4;

struct Norms {
  std::vector<double> time_s;
  std::vector<double> rate_radps;
  double spread = 0.0;
};

/// |omega| over bins: what differs in size by noise alone is not motion.
double motion_spread(const ImuTrack& track) {
  const ImuBins bins = bins_of(track, kPairMeanBins);
  const Eigen::Vector3d usual = plain_offset(track).cast<double>();
  double sum = 0.0;
  double squares = 0.0;
  double n = 0.0;
  for (std::size_t i = 0; i < bins.valid.size(); ++i) {
    if (!bins.valid[i]) continue;
    const double rate = (bins.omega_radps[i] - usual).norm();
    sum += rate;
    squares += rate * rate;
    n += 1.0;
  }
  return n > 0.0 ? std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n))) : 0.0;
}

Norms norms_of(const ImuTrack& track, double factor) {
  Norms norms;
  norms.time_s = track.time_s;
  norms.rate_radps.reserve(track.size());
  const Eigen::Vector3f usual = plain_offset(track);
  for (const Eigen::Vector3f& omega : track.omega_radps)
    norms.rate_radps.push_back(factor * static_cast<double>((omega - usual).norm()));
  return norms;
}

Result<TimeOffset> find_offset(const Norms& reference, Norms study, TimeScale scale) {
  TimeOffsetOptions options;
  options.search_s = kSearch_s;
  const RateMagnitudeSeries fixed{reference.time_s, reference.rate_radps};
  auto found = find_time_offset(fixed, {study.time_s, study.rate_radps}, options);
  if (found || scale == TimeScale::kShared) return found;
  const double lead_s = reference.time_s.front() - study.time_s.front();
  for (double& time : study.time_s) time += lead_s;
  auto again = find_time_offset(fixed, {study.time_s, study.rate_radps}, options);
  if (again) {
    again->offset_s += lead_s;
    again->study_origin_s -= lead_s;
  }
  return again;
}

/// Offset and rate of the S-IMU's clock; `track` gets the reference's times.
Result<TimeOffset> bring_together(const Norms& reference, ImuTrack& track, double factor, TimeScale scale) {
  TimeOffset all;
  const double origin_s = track.time_s.front();
  for (int round = 0; round < kClockRounds; ++round) {
    auto found = find_offset(reference, norms_of(track, factor), round == 0 ? scale : TimeScale::kShared);
    if (!found && round == 0) return found;
    if (!found) break;
    for (double& time : track.time_s)
      time += found->offset_s + found->clock_rate * (time - found->study_origin_s);
    all.offset_s += found->offset_s + found->clock_rate * (origin_s - found->study_origin_s);
    all.clock_rate += found->clock_rate;
    all.clock_rate_estimated = found->clock_rate_estimated;
    if (std::abs(found->clock_rate) < kClockRateMax) break;
  }
  return all;
}

/// Sums over the bins that both have.
struct Moments {
  Eigen::Matrix3d rates = Eigen::Matrix3d::Zero();   ///< study times reference', about the means
  Eigen::Matrix3d forces = Eigen::Matrix3d::Zero();  ///< the same, gravity and all
  Eigen::Matrix3d forces_bb = Eigen::Matrix3d::Zero();
  double rates_b = 0.0, rates_s = 0.0, forces_b = 0.0, forces_s = 0.0;
  Eigen::Vector3d mean_f_b = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_f_s = Eigen::Vector3d::Zero();
  double n = 0.0;
  /// The same with gravity out of both, and by part of the drive.
  [[nodiscard]] Eigen::Matrix3d forces_moving() const { return forces - n * mean_f_s * mean_f_b.transpose(); }
  std::array<Eigen::Vector3d, kParts> part_f_b = zeros();
  std::array<Eigen::Vector3d, kParts> part_f_s = zeros();
  std::array<double, kParts> part_n{};

 private:
  static std::array<Eigen::Vector3d, kParts> zeros() {
    std::array<Eigen::Vector3d, kParts> all;
    all.fill(Eigen::Vector3d::Zero());
    return all;
  }
};

Moments moments_of(const ImuBins& reference, const ImuBins& study) {
  Moments m;
  Eigen::Vector3d mean_b = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_s = Eigen::Vector3d::Zero();
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t i = 0; i < reference.valid.size(); ++i) {
      const std::int64_t bin = reference.first + static_cast<std::int64_t>(i);
      if (!reference.valid[i] || !study.has(bin)) continue;
      const std::size_t j = study.index(bin);
      if (pass == 0) {
        mean_b += reference.omega_radps[i];
        mean_s += study.omega_radps[j];
        m.mean_f_b += reference.f_mps2[i];
        m.mean_f_s += study.f_mps2[j];
        m.n += 1.0;
        const std::size_t part = i * kParts / reference.valid.size();
        m.part_f_b[part] += reference.f_mps2[i];
        m.part_f_s[part] += study.f_mps2[j];
        m.part_n[part] += 1.0;
        continue;
      }
      const Eigen::Vector3d b = reference.omega_radps[i] - mean_b;
      const Eigen::Vector3d s = study.omega_radps[j] - mean_s;
      const Eigen::Vector3d f_b = reference.f_mps2[i];
      const Eigen::Vector3d f_s = study.f_mps2[j];
      m.rates += s * b.transpose();
      m.rates_b += b.squaredNorm();
      m.rates_s += s.squaredNorm();
      m.forces += f_s * f_b.transpose();
      m.forces_bb += (f_b - m.mean_f_b) * (f_b - m.mean_f_b).transpose();
      m.forces_b += f_b.squaredNorm();
      m.forces_s += f_s.squaredNorm();
    }
    if (pass == 0 && m.n > 0.0) {
      mean_b /= m.n;
      mean_s /= m.n;
      m.mean_f_b /= m.n;
      m.mean_f_s /= m.n;
    }
  }
  return m;
}

/// The orthogonal matrix of this handedness (+1, -1; 0: any) that maximises trace(C' B).
Eigen::Matrix3d nearest_orthogonal(const Eigen::Matrix3d& B, int handedness) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(B, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double own = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if (handedness != 0 && own * handedness < 0.0) signs.z() = -1.0;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

double residual(double s, double b, const Eigen::Matrix3d& B, const Eigen::Matrix3d& C) {
  return std::max(s + b - 2.0 * C.cwiseProduct(B).sum(), 0.0);
}

int axes_changed(const Eigen::Matrix3d& D) {
  return static_cast<int>((D - Eigen::Matrix3d::Identity()).cwiseAbs().rowwise().sum().count());
}

/// Tries the namings of axes of one side: rates D-turned, forces as they are, mounting of either handedness.
class AxisSearch {
 public:
  explicit AxisSearch(const Moments& m) : m_(m) {
    // What no rotation explains: crooked triads, lever arms, noise.
    rate_floor_ = residual(m.rates_s, m.rates_b, m.rates, nearest_orthogonal(m.rates, 0));
    force_floor_ = residual(m.forces_s, m.forces_b, m.forces, nearest_orthogonal(m.forces, 0));
    constexpr double kRounding = 1e-9;
    rate_floor_ = std::max(rate_floor_, kRounding * m.rates_s);
    force_floor_ = std::max(force_floor_, kRounding * m.forces_s);
  }

  /// D turns the rates of the S-IMU (or of the reference) into those that fit.
  [[nodiscard]] double cost(const Eigen::Matrix3d& D, bool of_reference, int handedness,
                            Eigen::Matrix3d& C) const {
    const Eigen::Matrix3d rates =
        of_reference ? Eigen::Matrix3d(m_.rates * D.transpose()) : Eigen::Matrix3d(D * m_.rates);
    C = nearest_orthogonal(rates / rate_floor_ + m_.forces / force_floor_, handedness);
    return 0.5 * (residual(m_.rates_s, m_.rates_b, rates, C) / rate_floor_ +
                  residual(m_.forces_s, m_.forces_b, m_.forces, C) / force_floor_);
  }

  void search(PairAxes& out) const {
    Eigen::Matrix3d C;
    out.healthy_cost = cost(Eigen::Matrix3d::Identity(), false, 1, C);
    for (const bool of_reference : {false, true}) {
      double best = std::numeric_limits<double>::infinity();
      for (const Eigen::Matrix3d& D : signed_axes()) {
        for (const int handedness : {1, -1}) {
          const double at = cost(D, of_reference, handedness, C);
          const double simple = at * (1.0 + kPerAxis * axes_changed(D));
          if (simple >= best) continue;
          best = simple;
          take(D, handedness, of_reference, at, out);
        }
      }
    }
    out.fits = out.healthy_cost < kCostFactor * std::min(out.study_cost, out.reference_cost);
  }

 private:
  /// Which triad it is: the one that alone is of the wrong hand.
  static void take(const Eigen::Matrix3d& D, int handedness, bool of_reference, double cost, PairAxes& out) {
    Eigen::Matrix3d& gyro = of_reference ? out.reference_gyro : out.study_gyro;
    Eigen::Matrix3d& accel = of_reference ? out.reference_accel : out.study_accel;
    (of_reference ? out.reference_cost : out.study_cost) = cost;
    gyro = accel = Eigen::Matrix3d::Identity();
    if (handedness > 0) {
      gyro = D;
    } else if (D.determinant() < 0.0) {
      accel = D.transpose();
    } else {
      // Both are mirrored alike, or each in its own way: any axis may be turned to mend it.
      const Eigen::Matrix3d turn = Eigen::Vector3d(1.0, 1.0, -1.0).asDiagonal();
      gyro = turn * D;
      accel = turn;
    }
  }

  const Moments& m_;
  double rate_floor_ = 0.0;
  double force_floor_ = 0.0;
};

void report_unit(Drive& drive, std::size_t study, double ratio, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[study];
  const DeviceConfig& reference = drive.configuration().devices[drive.configuration().reference_index()];
  Finding finding{Harm::kWrong, "rate unit", config.name, {}, ratio, 1.0, "times the reference's rates",
                  {},           {}};
  constexpr double kThousandths = 1e3;
  const bool increments = std::abs(ratio * config.rate_hz - 1.0) < kRateUnitTolerance;
  const bool of_reference = std::abs(ratio / reference.rate_hz - 1.0) < kRateUnitTolerance;
  const bool thousandths = std::abs(ratio / (kThousandths * kDegPerRad) - 1.0) < kRateUnitTolerance;
  const bool degrees = std::abs(ratio / kDegPerRad - 1.0) < kRateUnitTolerance;
  const bool radians = std::abs(ratio * kDegPerRad - 1.0) < kRateUnitTolerance;
  if (degrees || radians) {
    const char* unit = degrees ? "deg/s" : "rad/s";
    finding.what = fmt::format("its gyros are in {}, read as {}", unit, degrees ? "rad/s" : "deg/s");
    finding.remedy = fmt::format("write gyro_unit = \"{}\" in its [device.csv]", unit);
    if (traits_of(config.protocol).is_text)
      finding.mends.push_back({config.name, "csv.gyro_unit", fmt::format("\"{}\"", unit)});
  } else if (increments) {
    finding.what = kIncrements;
    finding.remedy = divide_by_the_time_of_a_sample(config);
  } else if (of_reference) {
    finding.device = reference.name;
    finding.what = kIncrements;
    finding.remedy = divide_by_the_time_of_a_sample(reference);
  } else if (thousandths) {
    finding.what = "its gyros are in thousandths of a degree a second, read as rad/s";
    finding.remedy = "divide them by a thousand where they are written, and write gyro_unit = \"deg/s\"";
  } else {
    finding.what = "its rates are not of the size of the reference's";
    finding.remedy = "check gyro_unit and gyro_columns of both, and that both sit on one rigid body";
  }
  findings.push_back(std::move(finding));
}

/// @return the factor that brings the S-IMU's rates to the reference's size
double check_size(Drive& drive, std::size_t study, double reference_spread, std::vector<Finding>& findings) {
  const double spread = motion_spread(drive.imu(study));
  const double ratio = spread / reference_spread;
  if (ratio < kRatioMax && ratio > 1.0 / kRatioMax) return 1.0;
  report_unit(drive, study, ratio, findings);
  const bool unit = !findings.back().mends.empty();
  const double factor = ratio > 1.0 ? kRadPerDeg : kDegPerRad;
  if (unit) {
    for (Eigen::Vector3f& omega : drive.imu(study).omega_radps) omega *= static_cast<float>(factor);
  }
  return unit ? 1.0 : 1.0 / ratio;
}

void check_time(const DeviceConfig& config, TimeScale scale, const TimeOffset& offset,
                std::vector<Finding>& findings) {
  if (scale == TimeScale::kShared && std::abs(offset.offset_s) > kSharedOffsetMax_s) {
    Finding finding{Harm::kWrong,
                    "time of rates",
                    config.name,
                    fmt::format("its motion is the reference's {:.2f} s {}", std::abs(offset.offset_s),
                                offset.offset_s > 0.0 ? "later" : "earlier"),
                    offset.offset_s,
                    0.0,
                    "s",
                    "synchronise the clocks of what logs the two",
                    {}};
    if (traits_of(config.protocol).is_text) {
      finding.remedy = "write clock = \"own\" in its [device.csv]";
      finding.mends.push_back({config.name, "csv.clock", "\"own\""});
    }
    findings.push_back(std::move(finding));
  }
  if (offset.clock_rate_estimated && std::abs(offset.clock_rate) > kClockRateMax) {
    Finding finding{
        Harm::kWrong,
        "clock rate",
        config.name,
        fmt::format("its clock runs {} than the reference's", offset.clock_rate > 0.0 ? "slower" : "faster"),
        1e6 * offset.clock_rate,
        0.0,
        "ppm",
        "check what its times are made from (a counter times a nominal period?)",
        {}};
    if (traits_of(config.protocol).is_text) {
      const std::string unit = fmt::format("{:.6f}", config.csv.time_unit_s * (1.0 + offset.clock_rate));
      finding.remedy = fmt::format("write time_unit_s = {} in its [device.csv]", unit);
      finding.mends.push_back({config.name, "csv.time_unit_s", unit});
    }
    findings.push_back(std::move(finding));
  }
}

/// The rotation that rates and accelerations tell, without what gravity tells.
Eigen::Matrix3d rotation_by_motion(const Moments& m) {
  const Eigen::Matrix3d moving = m.forces_moving();
  return nearest_orthogonal(
      m.rates / std::max(m.rates_b, 1e-12) + moving / std::max(m.forces_bb.trace(), 1e-12), 1);
}

/// Whether the rotation of the motion leaves of the accelerations no more than any orthogonal one.
bool moves_alike(const Moments& m) {
  const Eigen::Matrix3d moving = m.forces_moving();
  const double s = m.forces_s - m.n * m.mean_f_s.squaredNorm();
  const double b = m.forces_b - m.n * m.mean_f_b.squaredNorm();
  const double left = residual(s, b, moving, rotation_by_motion(m));
  const double least = residual(s, b, moving, nearest_orthogonal(moving, 0));
  const double rates_left = residual(m.rates_s, m.rates_b, m.rates, rotation_by_motion(m));
  const double rates_least = residual(m.rates_s, m.rates_b, m.rates, nearest_orthogonal(m.rates, 0));
  return left + 1e-9 * s < kCostFactor * (least + 1e-9 * s) &&
         rates_left + 1e-9 * m.rates_s < kCostFactor * (rates_least + 1e-9 * m.rates_s);
}

/// Gravity that wanders in the S-IMU and not in the reference: it has turned on its place.
void check_moved(const DeviceConfig& config, const Moments& m, std::vector<Finding>& findings) {
  const Eigen::Matrix3d C = nearest_orthogonal(m.rates / m.rates_b + m.forces / m.forces_b, 1);
  double moved_mps2 = 0.0;
  std::array<Eigen::Vector3d, kParts> off{};
  for (std::size_t i = 0; i < kParts; ++i) {
    if (m.part_n[i] < static_cast<double>(kPairBinsMin) / kParts) continue;
    off[i] = (m.part_f_s[i] - C * m.part_f_b[i]) / m.part_n[i];
    for (std::size_t k = 0; k < i; ++k) {
      if (m.part_n[k] >= static_cast<double>(kPairBinsMin) / kParts)
        moved_mps2 = std::max(moved_mps2, (off[i] - off[k]).norm());
    }
  }
  if (moved_mps2 < kMovedMin_mps2) return;
  findings.push_back({Harm::kWrong,
                      "moved",
                      config.name,
                      "it turned on its place during the drive, or its accelerometers drifted far",
                      std::asin(std::min(moved_mps2 / kMps2PerG, 1.0)) * kDegPerRad,
                      0.0,
                      "deg",
                      "fasten it and drive again, or process the parts before and after by themselves",
                      {}});
}

/// A constant that is added to the forces turns gravity away from where the motion says it is.
/// @return whether there is one
bool check_accel_offset(const DeviceConfig& config, const Moments& m, std::vector<Finding>& findings) {
  const Eigen::Vector3d off = m.mean_f_s - rotation_by_motion(m) * m.mean_f_b;
  if (off.norm() < kAccelOffsetMax_mps2 || off.norm() > kAccelOffsetMost_mps2) return false;
  int axis = 0;
  off.cwiseAbs().maxCoeff(&axis);
  findings.push_back({Harm::kWrong,
                      "accelerometer offset",
                      config.name,
                      fmt::format("its {} accelerometer is off by a constant", "xyz"[axis]),
                      off[axis],
                      0.0,
                      "m/s2",
                      "take the offset out where it is written, and check that axis and its range",
                      {}});
  return true;
}

Finding not_alike(const DeviceConfig& config, double correlation) {
  return {Harm::kWrong,
          "one body",
          config.name,
          "it does not turn as the reference does",
          correlation,
          1.0,
          "(correlation of their rates)",
          "both must sit on one rigid body and record the same drive: check the "
          "files, gyro_columns and the mounting",
          {}};
}

/// A sample without the order and signs of its axes.
using Sizes = std::array<float, 6>;
Sizes sizes_of(const ImuTrack& track, std::size_t i) {
  const Eigen::Vector3f w = track.omega_radps[i].cwiseAbs();
  const Eigen::Vector3f f = track.f_mps2[i].cwiseAbs();
  Sizes sizes{w.x(), w.y(), w.z(), f.x(), f.y(), f.z()};
  std::sort(sizes.begin(), sizes.begin() + 3);
  std::sort(sizes.begin() + 3, sizes.end());
  return sizes;
}

/// Whether nearly all of the S-IMU's samples, to the last bit, are samples of the reference.
bool is_copy(const ImuTrack& reference, const ImuTrack& study) {
  std::vector<Sizes> known;
  known.reserve(reference.size());
  for (std::size_t i = 0; i < reference.size(); ++i) known.push_back(sizes_of(reference, i));
  std::sort(known.begin(), known.end());
  std::size_t same = 0;
  std::size_t looked_at = 0;
  const std::size_t step = std::max<std::size_t>(study.size() / kCopySamples, 1);
  for (std::size_t i = 0; i < study.size(); i += step, ++looked_at) {
    if (std::binary_search(known.begin(), known.end(), sizes_of(study, i))) ++same;
  }
  return static_cast<double>(same) > kCopyShare * static_cast<double>(looked_at);
}

}  // namespace

PairAxes check_pair(Drive& drive, std::size_t study, std::vector<Finding>& findings) {
  PairAxes axes;
  const std::size_t reference = drive.configuration().reference_index();
  const DeviceConfig& config = drive.configuration().devices[study];
  if (drive.imu(reference).size() < kPairBinsMin || drive.imu(study).size() < kPairBinsMin) return axes;
  if (is_copy(drive.imu(reference), drive.imu(study))) {
    findings.push_back({Harm::kWrong,
                        "copy",
                        config.name,
                        "its data are a copy of the reference's",
                        0.0,
                        0.0,
                        "",
                        "give the file of the S-IMU itself",
                        {}});
    return axes;
  }
  const double spread = motion_spread(drive.imu(reference));
  if (spread < kMotionMin_radps && motion_spread(drive.imu(study)) < kMotionMin_radps) return axes;
  const double factor = check_size(drive, study, spread, findings);
  ImuTrack track = drive.imu(study);
  const auto offset =
      bring_together(norms_of(drive.imu(reference), 1.0), track, factor, drive.time_scale(study));
  if (!offset) {
    findings.push_back(not_alike(config, 0.0));
    return axes;
  }
  const Moments m = moments_of(bins_of(drive.imu(reference), kPairMeanBins), bins_of(track, kPairMeanBins));
  if (m.n < static_cast<double>(kPairBinsMin)) return axes;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m.rates);
  const double correlation = svd.singularValues().sum() / std::sqrt(m.rates_s * m.rates_b);
  if (correlation < kCorrelationMin) {
    findings.push_back(not_alike(config, correlation));
    return axes;
  }
  check_time(config, drive.time_scale(study), *offset, findings);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> forces(m.forces_bb / m.n);
  if (std::sqrt(std::max(forces.eigenvalues()[1], 0.0)) < kForcesMin_mps2) return axes;
  axes.compared = true;
  AxisSearch(m).search(axes);
  if (axes.fits) check_moved(config, m, findings);
  // Where accelerations fit as they are, it is not the axes that gravity contradicts.
  if (!axes.fits && moves_alike(m) && check_accel_offset(config, m, findings)) axes.fits = true;
  return axes;
}

}  // namespace imuscope::check
