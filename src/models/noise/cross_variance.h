#pragma once

/// Several signals at once, scale by scale: what they have in common, what is each one's own, and the weights
/// with which their mean is quietest.
///
/// The signals are sampled together: S-IMUs on one reference, or the axes of one sensor. W_j of the sum and
/// of the difference of two signals tell their wavelet cross-covariance, so that gaps cost what they cost a
/// single signal.

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "base/for_each_index.h"
#include "base/result.h"
#include "models/noise/fit.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// Covariance of the coefficients of all signals at one scale (G-60).
struct CrossLevel {
  int level = 0;  ///< j, from 1
  double tau_samples = 0.0;
  Eigen::MatrixXd
      covariance;    ///< gamma_ik, product of the signals' units; its diagonal is the wavelet variance
  double dof = 0.0;  ///< independent squares that the level is worth (G-61)
};

/// What a quadratic form of a scale's covariance is, with its interval.
struct Estimate {
  double value = 0.0;
  double ci_low = 0.0;
  double ci_high = 0.0;
};

/// Correlation of the coefficients of two signals at one scale.
struct Coherence {
  double value = 0.0;  ///< -1 to 1
  double ci_low = -1.0;
  double ci_high = 1.0;
  double p_value = 1.0;  ///< of no correlation at all
};

/// Covariance of all scales that have a coefficient.
/// @param signals  two or more of one length
/// @param mask     one entry a sample, non-zero where all signals are valid; empty: everywhere
/// @param fits     a model of each, by which its coefficients are correlated in time
/// @param tables   to take covariances from; nothing: each is computed by itself
/// @param for_each  how the pairs are gone through
/// Errors (kWork): those of haar_wavelet_variance(); signals of different lengths.
Result<std::vector<CrossLevel>> cross_variance(std::span<const std::span<const double>> signals,
                                               std::span<const std::uint8_t> mask,
                                               std::span<const FitResult> fits,
                                               CovarianceTables* tables = nullptr,
                                               const ForEachIndex& for_each = one_by_one);

/// tr(A gamma) with its interval (G-62).
/// @param form  A, symmetric, of as many rows as there are signals
Estimate estimate_of(const CrossLevel& level, const Eigen::MatrixXd& form, double confidence);

/// Of the signals i and k (G-60).
Estimate cross_covariance_of(const CrossLevel& level, Eigen::Index i, Eigen::Index k, double confidence);
Coherence coherence_of(const CrossLevel& level, Eigen::Index i, Eigen::Index k, double confidence);

/// Variance of what all signals have in common: of S-IMUs on one reference, the reference's own (G-63).
Estimate common_of(const CrossLevel& level, double confidence);
/// Variance of what signal i has for itself. Its ends may be below zero where it is not told.
Estimate own_of(const CrossLevel& level, Eigen::Index i, double confidence);

/// Weights of sum one whose mean has the least wavelet variance at the scales given, each scale counted alike
/// (G-64). Negative ones are possible where signals have much in common. Precondition: at least one scale.
Eigen::VectorXd quietest_weights(std::span<const CrossLevel> scales);

/// Wavelet variance of the weighted mean at a scale.
double weighted_variance(const CrossLevel& level, const Eigen::VectorXd& weights);

}  // namespace imuscope::noise
