#include "models/noise/cross_variance.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "models/noise/chi_squared.h"
#include "models/noise/covariance_table.h"
#include "models/noise/fixed_point.h"

namespace imuscope::noise {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// G-61 of one signal: independent squares of each level, by its model.
VectorXd dof_of(const FitResult& fit, const WaveletVariance& wv, CovarianceTables* tables) {
  const auto n = static_cast<Index>(std::min(wv.levels.size(), fit.wv.size()));
  const auto table = tables != nullptr ? tables->of(wv, static_cast<std::size_t>(n)) : nullptr;
  const MatrixXd covariance = sampling_covariance(fit.model, wv, static_cast<std::size_t>(n), table.get());
  VectorXd dof(n);
  for (Index j = 0; j < n; ++j) {
    const double nu = fit.wv[static_cast<std::size_t>(j)].fitted;
    dof[j] = 2.0 * nu * nu / covariance(j, j);
  }
  return dof;
}

/// G-60: gamma_ik = (nu of the sum - nu of the difference) / 4, both scaled to one size so that neither
/// drowns.
std::vector<double> pair_covariance(std::span<const double> x, std::span<const double> y, double scale,
                                    const WvOptions& options, std::size_t levels) {
  std::vector<double> both(x.size());
  for (std::size_t t = 0; t < x.size(); ++t) both[t] = x[t] + scale * y[t];
  const auto of_sum = haar_wavelet_variance_in_place(both, options);
  for (std::size_t t = 0; t < x.size(); ++t) both[t] = x[t] - scale * y[t];
  const auto of_difference = haar_wavelet_variance_in_place(both, options);
  std::vector<double> gamma(levels, 0.0);
  if (!of_sum || !of_difference) return gamma;
  for (std::size_t j = 0; j < levels; ++j)
    gamma[j] = 0.25 * (of_sum->levels[j].value - of_difference->levels[j].value) / scale;
  return gamma;
}

/// A symmetric matrix whose square is the covariance; what sampling made negative is zero.
MatrixXd root_of(const MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(covariance);
  const VectorXd roots = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return solver.eigenvectors() * roots.asDiagonal() * solver.eigenvectors().transpose();
}

/// Where every signal is there.
std::vector<std::uint8_t> joint_mask(std::span<const std::span<const double>> signals,
                                     std::span<const std::uint8_t> mask) {
  std::vector<std::uint8_t> joint(signals.front().size(), 1);
  for (std::size_t t = 0; t < joint.size(); ++t) {
    if (!mask.empty() && mask[t] == 0) joint[t] = 0;
    for (const auto& signal : signals) {
      if (!std::isfinite(signal[t])) joint[t] = 0;
    }
  }
  return joint;
}

/// G-63: the mean over the pairs.
MatrixXd common_form(Index n) {
  const auto count = static_cast<double>(n);
  return (MatrixXd::Ones(n, n) - MatrixXd::Identity(n, n)) / (count * (count - 1.0));
}

}  // namespace

Result<std::vector<CrossLevel>> cross_variance(std::span<const std::span<const double>> signals,
                                               std::span<const std::uint8_t> mask,
                                               std::span<const FitResult> fits, CovarianceTables* tables,
                                               const ForEachIndex& for_each) {
  const auto n = static_cast<Index>(signals.size());
  for (const auto& signal : signals) {
    if (signal.size() != signals.front().size())
      return work_error(fmt::format("signals of {} and {} samples", signals.front().size(), signal.size()));
  }
  if (!mask.empty() && mask.size() != signals.front().size())
    return work_error(fmt::format("a mask of {} for {} samples", mask.size(), signals.front().size()));
  const std::vector<std::uint8_t> joint = joint_mask(signals, mask);
  WvOptions options;
  options.mask = joint;
  std::vector<Result<WaveletVariance>> looked_at(signals.size(), work_error("not looked at"));
  for_each(signals.size(), [&](std::size_t i) { looked_at[i] = haar_wavelet_variance(signals[i], options); });
  std::vector<WaveletVariance> own;
  for (auto& wv : looked_at) {
    if (!wv) return tl::unexpected(wv.error());
    own.push_back(std::move(*wv));
  }
  std::size_t levels = own.front().levels.size();
  std::vector<VectorXd> dof;
  for (std::size_t i = 0; i < own.size(); ++i) {
    dof.push_back(dof_of(fits[i], own[i], tables));
    levels = std::min(levels, static_cast<std::size_t>(dof.back().size()));
  }
  std::vector<CrossLevel> out(levels);
  for (std::size_t j = 0; j < levels; ++j) {
    out[j].level = own.front().levels[j].level;
    out[j].tau_samples = own.front().levels[j].tau_samples;
    out[j].covariance = MatrixXd::Zero(n, n);
    // G-61. Of signals whose coefficients hang together in time differently: the mean of 1/dof.
    double inverse = 0.0;
    for (const auto& one : dof) inverse += 1.0 / one[static_cast<Index>(j)];
    out[j].dof = static_cast<double>(n) / inverse;
    for (Index i = 0; i < n; ++i) out[j].covariance(i, i) = own[static_cast<std::size_t>(i)].levels[j].value;
  }
  std::vector<std::pair<Index, Index>> pairs;
  for (Index i = 0; i < n; ++i) {
    for (Index k = 0; k < i; ++k) pairs.emplace_back(i, k);
  }
  for_each(pairs.size(), [&](std::size_t p) {
    const auto [i, k] = pairs[p];
    const auto& x = own[static_cast<std::size_t>(i)].levels.front();
    const auto& y = own[static_cast<std::size_t>(k)].levels.front();
    const double scale = y.value > 0.0 && x.value > 0.0 ? std::sqrt(x.value / y.value) : 1.0;
    const auto gamma = pair_covariance(signals[static_cast<std::size_t>(i)],
                                       signals[static_cast<std::size_t>(k)], scale, options, levels);
    for (std::size_t j = 0; j < levels; ++j) out[j].covariance(i, k) = out[j].covariance(k, i) = gamma[j];
  });
  return out;
}

// G-62
Estimate estimate_of(const CrossLevel& level, const MatrixXd& form, double confidence) {
  const double alpha = 1.0 - confidence;
  const MatrixXd root = root_of(level.covariance);
  const VectorXd shares =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(root * form * root, Eigen::EigenvaluesOnly).eigenvalues();
  const double least = level.dof / chi_squared_quantile(level.dof, 1.0 - 0.5 * alpha);
  const double most = level.dof / chi_squared_quantile(level.dof, 0.5 * alpha);
  double below = 0.0;
  double above = 0.0;
  for (const double share : shares) {
    const double small = share * (1.0 - least);
    const double large = share * (most - 1.0);
    below += share > 0.0 ? small * small : large * large;
    above += share > 0.0 ? large * large : small * small;
  }
  const double value = (form * level.covariance).trace();
  return {value, value - std::sqrt(below), value + std::sqrt(above)};
}

Estimate cross_covariance_of(const CrossLevel& level, Index i, Index k, double confidence) {
  MatrixXd form = MatrixXd::Zero(level.covariance.rows(), level.covariance.cols());
  form(i, k) += 0.5;
  form(k, i) += 0.5;
  return estimate_of(level, form, confidence);
}

Coherence coherence_of(const CrossLevel& level, Index i, Index k, double confidence) {
  Coherence out;
  const double size = std::sqrt(level.covariance(i, i) * level.covariance(k, k));
  if (!(size > 0.0)) return out;
  out.value = std::clamp(level.covariance(i, k) / size, -1.0, 1.0);
  // G-65. The coefficients' mean is known to be zero: as many pairs as squares.
  constexpr double kFewestPairs = 2.0;
  if (level.dof > kFewestPairs) {
    const double half = boost::math::quantile(boost::math::normal(), 0.5 + 0.5 * confidence) /
                        std::sqrt(level.dof - kFewestPairs);
    const double z = std::atanh(std::clamp(out.value, -1.0 + 1e-15, 1.0 - 1e-15));
    out.ci_low = std::tanh(z - half);
    out.ci_high = std::tanh(z + half);
  }
  const double freedom = std::max(level.dof - 1.0, 1.0);
  const double rest = 1.0 - out.value * out.value;
  if (rest <= 0.0) {
    out.p_value = 0.0;
    return out;
  }
  const double t = std::abs(out.value) * std::sqrt(freedom / rest);
  out.p_value = 2.0 * boost::math::cdf(boost::math::complement(boost::math::students_t(freedom), t));
  return out;
}

Estimate common_of(const CrossLevel& level, double confidence) {
  return estimate_of(level, common_form(level.covariance.rows()), confidence);
}

// G-63: one signal's own
Estimate own_of(const CrossLevel& level, Index i, double confidence) {
  MatrixXd form = -common_form(level.covariance.rows());
  form(i, i) += 1.0;
  return estimate_of(level, form, confidence);
}

// G-64
VectorXd quietest_weights(std::span<const CrossLevel> scales) {
  const Index n = scales.front().covariance.rows();
  MatrixXd sum = MatrixXd::Zero(n, n);
  for (const CrossLevel& scale : scales) sum += scale.covariance / scale.covariance.diagonal().mean();
  // Signals that are the same leave their weights open: of all solutions the shortest, which is the plain
  // mean then.
  const VectorXd ones = VectorXd::Ones(n);
  const VectorXd weights = sum.completeOrthogonalDecomposition().solve(ones);
  const double total = weights.sum();
  if (!weights.allFinite() || !(total > 0.0)) return ones / static_cast<double>(n);
  return weights / total;
}

double weighted_variance(const CrossLevel& level, const VectorXd& weights) {
  return weights.dot(level.covariance * weights);
}

}  // namespace imuscope::noise
