#pragma once

/// Several records of one moment: the same axis of S-IMUs on one reference, or the axes of one sensor. What
/// they have in common, what is each one's own, and the mean that is quietest.

#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/cross_variance.h"

namespace imuscope::certificate {

/// One signal of several that were sampled together; missing samples are NaN.
struct JointSignal {
  std::string name;  ///< of the S-IMU, or of the axis
  std::span<const double> values;
};

/// One time scale.
struct JointScale {
  double tau_s = 0.0;
  double squares = 0.0;  ///< independent ones that it is worth
  noise::Estimate common;
  std::vector<noise::Estimate> own;  ///< one a signal
  std::vector<double> variance;      ///< wavelet variance of each signal
  double mean_variance = 0.0;        ///< of the quietest mean
};

/// Coherence of two signals at the scale where it is plainest.
struct JointPair {
  std::size_t first = 0;
  std::size_t second = 0;
  double tau_s = 0.0;
  noise::Coherence coherence;
  double p_holm = 1.0;  ///< of no coherence at any scale of any pair, corrected for their number (Holm 1979)

  /// Whether there is coherence, and its interval says more than a tenth: what long records prove of less is
  /// worth nobody's while.
  [[nodiscard]] bool shows() const;
};

struct JointAxes {
  double rate_hz = 0.0;
  std::uint64_t samples = 0;  ///< instants at which all signals are there
  std::vector<JointScale> scales;
  std::vector<JointPair> pairs;
  std::vector<double> weights;  ///< of the quietest mean; empty where no scale is worth enough squares
  double from_s = 0.0;          ///< shortest and longest scale that the weights were made of
  double to_s = 0.0;
  /// Root of the wavelet variance of the mean over that of the best single signal at those scales. In
  /// `held_out` both were chosen on one half of the record and measured on the other.
  double ratio = 1.0;
  double held_out = 1.0;
};

struct JointOptions {
  double rate_hz = 0.0;
  double confidence = 0.95;
  double from_s = 0.0;  ///< scales at which the mean is to be quiet
  double to_s = 1e9;
  /// Of other fits of the same record; nothing: the signals share tables of their own.
  noise::CovarianceTables* covariances = nullptr;
  bool share_a_reference = true;  ///< false: no common part and no mean, as for axes of one sensor
};

/// Below so many squares a scale's weights would cost more than they gain: K - 1 of them are lost (G-64).
inline constexpr double kSquaresOfWeights = 200.0;

/// Errors (kWork): fewer than two signals, too few samples that all have; (kUsage) no scale between from_s
/// and to_s that is worth kSquaresOfWeights.
Result<JointAxes> joint_axes(std::span<const JointSignal> signals, const JointOptions& options);

}  // namespace imuscope::certificate
