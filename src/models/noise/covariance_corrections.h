#pragma once

/// Of wv_covariance() and CovarianceTable alone: what stands beside the sum over lags.

#include <Eigen/Core>
#include <vector>

#include "models/noise/cross_covariance.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// G-44: what the product of a sinusoid with the rest of the model adds.
double sinusoid_covariance(const Parts& parts, const WvLevel& j, const WvLevel& k);

/// G-10. Quantization is a difference of uniform numbers, whose fourth cumulant narrows the wavelet
/// variance's spread by kappa q2^2 sum_i A_j(i) A_k(i) / (M_j M_k), A_j(i) the summed squared weights of
/// number i at level j.
double uniform_correction(double q2, const std::vector<Segment>& runs, const WvLevel& j, const WvLevel& k);

/// G-34: what missing samples add to two levels behaves as white noise of this variance.
double white_of_missing(const WvLevel& j, const WvLevel& k);

/// The nearest matrix of the same variances whose correlations have no eigenvalue below 0.01. Counts of pairs
/// that are told by shares and by few break points may leave a matrix that is no covariance; those of whole
/// records have none below twice that.
Eigen::MatrixXd bounded_below(const Eigen::MatrixXd& v);

}  // namespace imuscope::noise
