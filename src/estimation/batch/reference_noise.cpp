#include "estimation/batch/reference_noise.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <vector>

namespace imuscope::batch {

namespace {

/// What is believed of a share before the drive: both IMUs alike, nearly anything possible.
constexpr double kPriorShare = 0.5;
constexpr double kPriorSd = 0.5;
/// sd by which a share changes from one band to the next: noise of IMUs is smooth.
constexpr double kWalk = 0.1;
/// sd of a band's gain about the sensor's: what a body that is not rigid adds to or takes from motion.
constexpr double kGainSd = 0.01;
/// The S-IMU has some noise itself.
constexpr double kLargestShare = 0.95;

/// Power that the record shows nearly always, and what a window shows beyond it.
struct Parts {
  double record;
  double excess;
};

Parts parts_of(const NoiseBands& noise, Eigen::Index window, Eigen::Index band, Eigen::Index triad) {
  const double here = noise.window_power(window, band).segment<3>(3 * triad).mean();
  const double record = noise.power(band).segment<3>(3 * triad).mean();
  return {std::min(here, record), std::max(0.0, here - record)};
}

/// Information about the two shares of one band and triad, the band's gain eliminated.
struct Told {
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d score = Eigen::Vector2d::Zero();

  void add(const Told& other) {
    information += other.information;
    score += other.score;
  }
  /// What it tells of the neighbouring band.
  void walk() {
    const Eigen::Matrix2d grown = (Eigen::Matrix2d::Identity() + kWalk * kWalk * information).inverse();
    score = grown * score;
    information = grown * information;
  }
};

/// B-10a: Q = share times noise plus gain error times motion, window by window.
class BandRegression {
 public:
  void add(double Q, double motion_power, const Parts& noise, double numbers) {
    const double total = noise.record + noise.excess;
    // Of the expected power: weights by what a window happens to show would prefer those that show little.
    const double variance = (motion_power + total) * total / numbers;
    if (!(variance > 0.0)) return;
    const Eigen::Vector3d x(noise.record, noise.excess, motion_power);
    normal_ += x * x.transpose() / variance;
    right_ += x * Q / variance;
  }

  [[nodiscard]] Told told() const {
    const double gain = normal_(2, 2) + 1.0 / (kGainSd * kGainSd);
    const Eigen::Vector2d cross = normal_.topRightCorner<2, 1>();
    Told told;
    told.information = normal_.topLeftCorner<2, 2>() - cross * cross.transpose() / gain;
    told.score = right_.head<2>() - cross * right_[2] / gain;
    return told;
  }

 private:
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
};

/// The shares of one band and triad.
struct Shares {
  Eigen::Vector2d mean;
  Eigen::Vector2d sd;
};

/// B-10a: each band's shares with what its neighbours tell of them: a random walk over the bands, both ways.
std::vector<Shares> smoothed(const std::vector<Told>& bands) {
  const std::size_t n = bands.size();
  std::vector<Told> below(n);
  std::vector<Told> above(n);
  for (std::size_t i = 1; i < n; ++i) {
    below[i] = below[i - 1];
    below[i].add(bands[i - 1]);
    below[i].walk();
  }
  for (std::size_t i = n - 1; i-- > 0;) {
    above[i] = above[i + 1];
    above[i].add(bands[i + 1]);
    above[i].walk();
  }
  constexpr double kPrior = 1.0 / (kPriorSd * kPriorSd);
  std::vector<Shares> shares(n);
  for (std::size_t i = 0; i < n; ++i) {
    Told all = bands[i];
    all.add(below[i]);
    all.add(above[i]);
    all.information.diagonal().array() += kPrior;
    all.score.array() += kPrior * kPriorShare;
    const Eigen::Matrix2d covariance = all.information.inverse();
    shares[i].mean = (covariance * all.score).cwiseMax(0.0).cwiseMin(kLargestShare);
    shares[i].sd = covariance.diagonal().cwiseSqrt();
  }
  return shares;
}

}  // namespace

ReferenceNoise ReferenceNoise::even(const Bands& bands, double share) {
  ReferenceNoise out;
  out.of_record_.setConstant(bands.size(), 2, share);
  out.of_excess_.setConstant(bands.size(), 2, share);
  out.of_record_sd_.setZero(bands.size(), 2);
  out.of_excess_sd_.setZero(bands.size(), 2);
  return out;
}

ReferenceNoise::ReferenceNoise(
    const WindowPlan& plan, const Bands& bands, const Spectra& reference,
    const Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 6, Eigen::RowMajor>& residual,
    const SensorState& sensor, const NoiseBands& noise) {
  const auto n_windows = static_cast<Eigen::Index>(plan.starts.size());
  const Transfer t(sensor, DeviationVector::Zero());
  std::array<std::vector<Told>, 2> told;
  shown_.resize(n_windows * bands.size(), 2);
  for (Eigen::Index band = 0; band < bands.size(); ++band) {
    const double values = 3.0 * static_cast<double>(bands.width(band)) / kWindowsPerInstant;
    std::array<BandRegression, 2> regressions;
    for (Eigen::Index w = 0; w < n_windows; ++w) {
      Eigen::Vector2d motion_power = Eigen::Vector2d::Zero();
      Eigen::Vector2d against = Eigen::Vector2d::Zero();
      for (Eigen::Index k = bands.first(band); k < bands.end(band); ++k) {
        const Motion motion = motion_of(reference, w, k);
        // B-10a: power of u, and what of it stands in e with the other sign
        const Vector3c rates = t.gyro * motion.omega;
        const Vector3c forces = accelerometers(t, motion);
        const auto e = residual.row(w * plan.n_frequencies + k);
        motion_power += Eigen::Vector2d(rates.squaredNorm(), forces.squaredNorm());
        against -= Eigen::Vector2d((e.head<3>() * rates.conjugate()).value().real(),
                                   (e.tail<3>() * forces.conjugate()).value().real());
      }
      motion_power /= values;
      against /= values;
      shown_.row(w * bands.size() + band) = motion_power.transpose();
      for (Eigen::Index triad = 0; triad < 2; ++triad) {
        const Parts parts = parts_of(noise, w, band, triad);
        const double claimed = noise.claimed(band);
        regressions[static_cast<std::size_t>(triad)].add(against[triad], motion_power[triad],
                                                         {parts.record / claimed, parts.excess / claimed},
                                                         2.0 * values);
      }
    }
    for (std::size_t triad = 0; triad < 2; ++triad) told[triad].push_back(regressions[triad].told());
  }
  of_record_.resize(bands.size(), 2);
  of_excess_.resize(bands.size(), 2);
  of_record_sd_.resize(bands.size(), 2);
  of_excess_sd_.resize(bands.size(), 2);
  for (Eigen::Index triad = 0; triad < 2; ++triad) {
    const auto shares = smoothed(told[static_cast<std::size_t>(triad)]);
    for (Eigen::Index band = 0; band < bands.size(); ++band) {
      const Shares& own = shares[static_cast<std::size_t>(band)];
      of_record_(band, triad) = own.mean[0];
      of_excess_(band, triad) = own.mean[1];
      of_record_sd_(band, triad) = own.sd[0];
      of_excess_sd_(band, triad) = own.sd[1];
    }
  }
}

ReferenceNoise ReferenceNoise::shifted(Eigen::Index triad) const {
  ReferenceNoise out = *this;
  out.of_record_.col(triad) = (of_record_ + of_record_sd_).col(triad).cwiseMin(kLargestShare);
  out.of_excess_.col(triad) = (of_excess_ + of_excess_sd_).col(triad).cwiseMin(kLargestShare);
  return out;
}

// B-10a: R of a window
Eigen::Vector2d ReferenceNoise::power(const NoiseBands& noise, Eigen::Index window, Eigen::Index band) const {
  Eigen::Vector2d power;
  for (Eigen::Index triad = 0; triad < 2; ++triad) {
    const Parts parts = parts_of(noise, window, band, triad);
    power[triad] = of_record_(band, triad) * parts.record + of_excess_(band, triad) * parts.excess;
  }
  if (shown_.rows() == 0) return power;
  return power.cwiseMin(shown_.row(window * of_record_.rows() + band).transpose());
}

Eigen::Vector2d ReferenceNoise::mean_share(const NoiseBands& noise, Eigen::Index band) const {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  const Eigen::Index n = noise.windows();
  for (Eigen::Index w = 0; w < n; ++w) {
    const Eigen::Matrix<double, 6, 1> all = noise.window_power(w, band);
    sum += power(noise, w, band).cwiseQuotient(Eigen::Vector2d(all.head<3>().mean(), all.tail<3>().mean()));
  }
  return sum / static_cast<double>(n);
}

}  // namespace imuscope::batch
