#pragma once

/// Covariance matrix of the wavelet variances of a Gaussian signal that follows a model, in closed form:
///
///   Cov(wv_j, wv_k) = 1/(M_j M_k) sum_h N_jk(h) [ 2 C_jk(h)^2 + 4 m_j m_k C_jk(h) ],
///
/// C_jk(h) = Cov(W_j,t, W_k,t+h), m_j the mean of W_j that a ramp causes, N_jk(h) the number of coefficient
/// pairs at lag h. W_j is a second difference of the summed signal, so C_jk is a fourth difference of one
/// function G of the lag, which every process has in closed form.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "models/noise/model.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// C_jk(h) of the model without its ramp and sinusoids.
double coefficient_covariance(const Model& model, int level_j, int level_k, double lag);

/// Rows and columns in the order of `wv.levels`, the first `levels` of them. The pair counts follow the
/// segments; where those are not known, the coefficients of each level count as one run. Of a robust wavelet
/// variance the squares' 2 C^2 gives way to the series of biweight_correlation_terms(). Relative error of an
/// entry about 1e-3.
Eigen::MatrixXd wv_covariance(const Model& model, const WaveletVariance& wv, std::size_t levels);

/// Covariance of the differences of the classical and the robust wavelet variance of one Gaussian signal:
/// what the robust one varies by more (G-35).
/// @param robust  the robust one
Eigen::MatrixXd robust_loss(const Model& model, const WaveletVariance& robust, std::size_t levels);

}  // namespace imuscope::noise
