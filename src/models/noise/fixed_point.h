#pragma once

/// The fit whose weights are its own: a model, and the covariance of the wavelet variance under that very
/// model, which weighs the levels that the model is fitted to. Where the model does not explain the data,
/// with an error of the model itself in the weights, which belongs to the same point.

#include <Eigen/Core>
#include <optional>
#include <span>

#include "models/noise/covariance_table.h"
#include "models/noise/separable_fit.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// A model where the iteration of weights and fit rests, and what belongs to it.
struct FixedPoint {
  Model model;
  double objective = 0.0;    ///< under the weights
  Eigen::MatrixXd sampling;  ///< covariance of the wavelet variance under the model
  Eigen::MatrixXd v;  ///< the same with the model's error and, where it did not settle, what it roamed over
  double model_error = 0.0;  ///< share of every level; 0: none allowed for
  bool settled = true;
};

/// The levels that are fitted, as a problem whose weights are set by the functions below.
struct WeightedProblem {
  const WaveletVariance& wv;
  SeparableProblem problem;
  const CovarianceTable* table = nullptr;  ///< of `wv`; nothing: wv_covariance()

  [[nodiscard]] std::size_t levels() const { return problem.levels.size(); }
};

/// Parameters of the terms that are not zero.
int parameters_in_use(const Model& model);

/// Observed minus fitted.
Eigen::VectorXd residual_of(const SeparableProblem& problem, const Model& model);

/// L^-1 of v = L L'; empty when v is not positive definite.
Eigen::MatrixXd whitener_of(const Eigen::MatrixXd& v);

/// wv_covariance() made positive definite.
/// @param table  of `wv`, to take it from
Eigen::MatrixXd sampling_covariance(const Model& model, const WaveletVariance& wv, std::size_t levels,
                                    const CovarianceTable* table = nullptr);

/// Weights from the model's own covariance, iterated from `start` until a round moves no level by more than a
/// small part of its sd. The first round searches all rates where `search` is set.
FixedPoint settle(WeightedProblem& problem, const Model& start, bool search);

/// A model that cannot follow the data is pulled to the levels with the smallest sampling errors and leaves
/// the others by factors. Here every level gets an error of the model on top, one share of its value for all,
/// as large as the residuals say: the objective equals the levels minus the parameters of the terms that are
/// not zero. Its scale, 2 y m^2 / (y + m) for the square, makes the stationary point that of the cost
/// m/y + y/m: too high and too low by one factor weigh alike. Sampling covariance and error follow the model
/// to where it rests.
///
/// @param start  nothing: a search over all rates, ignorant of sampling errors
/// @param share  model error to start from, 0 where unknown
FixedPoint settle_with_model_error(WeightedProblem& problem, const std::optional<Model>& start, double share);

}  // namespace imuscope::noise
