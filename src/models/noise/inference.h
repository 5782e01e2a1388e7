#pragma once

/// What a fit may say about its parameters: their covariance, intervals, whether they can be told apart at
/// all, and whether the model explains the wavelet variance.

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "models/noise/fit.h"

namespace imuscope::noise {

/// In fewer correlation times a process looks like a random walk of any level: of the records that seem to
/// show more, most have a rate by chance (of 100 with 3.3, a half, and their intervals held the truth in two
/// thirds).
inline constexpr double kFewestCorrelationTimes = 20.0;

/// A parameter's place in the model and the scale on which its interval is made.
struct ParameterPlace {
  std::size_t component = 0;
  int shape = -1;  ///< shape value, or -1: the amplitude
};

/// Places in the order of FitResult::parameters: for each component its shapes, then its amplitude.
std::vector<ParameterPlace> parameter_places(const Model& model);

/// Wavelet variance of the model, one value a level.
Eigen::VectorXd wv_curve(const Model& model, const std::vector<int>& levels);

/// d(model wv)/d(parameter on its interval scale: log of amplitudes, search coordinate of shapes), one row a
/// level.
Eigen::MatrixXd wv_jacobian(const Model& model, const std::vector<int>& levels,
                            const std::vector<ParameterPlace>& places);

/// G-13. Covariance of the parameters whose amplitude is not zero; NaN rows and columns for the others and
/// for those the data do not determine. `v` is the covariance of the wavelet variance, `omega` the weights of
/// the fit.
struct ParameterCovariance {
  Eigen::MatrixXd covariance;
  std::vector<bool> determined;
};
ParameterCovariance parameter_covariance(const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& v,
                                         const Eigen::MatrixXd& omega, const std::vector<bool>& present);

/// Test of the model on the levels with enough coefficients (wavelet_variance.h). The part of the residual
/// that the parameters could still follow is projected out, so the test holds for every weighting of the fit.
/// @param by_these_weights  the model is the best by the weights v^-1 of all levels: no more of the residual
///                          than the other levels explain can be followed, and what is beyond that counts
std::optional<JTest> j_test(const WaveletVariance& wv, const Eigen::VectorXd& residual,
                            const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& v,
                            const std::vector<bool>& present, bool by_these_weights);

/// value - expected with the skewness of a wavelet variance of few degrees of freedom taken out: the
/// difference of cube roots (Wilson and Hilferty 1931), scaled so that it keeps the variance.
double near_gaussian_residual(double value, double expected, double variance);

/// Fills parameters (values and intervals), covariance, identifiable, simpler_model and warnings of `result`,
/// whose model, spec and rate are set.
void report_parameters(FitResult& result, const ParameterCovariance& covariance, const FitOptions& options,
                       int highest_level);

}  // namespace imuscope::noise
