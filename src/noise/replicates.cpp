#include "noise/replicates.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

#include "base/contracts.h"
#include "noise/compare.h"
#include "noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Levels with at least this many times 2^j coefficients are near enough to Gaussian for a test.
constexpr double kEnough = 3.0;

double p_value_of(double statistic, int dof) {
  return boost::math::cdf(complement(boost::math::chi_squared(dof), statistic));
}

/// Parameters that every fit determines.
std::vector<Eigen::Index> common_parameters(const std::vector<FitResult>& fits) {
  std::vector<Eigen::Index> common;
  for (std::size_t p = 0; p < fits.front().parameters.size(); ++p) {
    const bool all = std::all_of(fits.begin(), fits.end(),
                                 [&](const FitResult& f) { return f.parameters[p].sd.has_value(); });
    if (all) common.push_back(static_cast<Eigen::Index>(p));
  }
  return common;
}

std::optional<JTest> homogeneity_of(const std::vector<FitResult>& fits) {
  const auto common = common_parameters(fits);
  if (common.empty()) return std::nullopt;
  const auto n = static_cast<Eigen::Index>(common.size());
  const auto size = static_cast<Eigen::Index>(fits.front().parameters.size());
  std::vector<Eigen::VectorXd> values;
  std::vector<Eigen::MatrixXd> weights;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd weighted = Eigen::VectorXd::Zero(n);
  for (const FitResult& fit : fits) {
    Eigen::VectorXd value(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      value[i] =
          on_interval_scale(fit.parameters[static_cast<std::size_t>(common[static_cast<std::size_t>(i)])]);
    }
    const Eigen::Map<const Eigen::MatrixXd> all(fit.covariance.data(), size, size);
    const Eigen::MatrixXd covariance = all(common, common);
    const Eigen::MatrixXd weight = covariance.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
    total += weight;
    weighted += weight * value;
    values.push_back(value);
    weights.push_back(weight);
  }
  const Eigen::VectorXd mean = total.ldlt().solve(weighted);
  JTest test;
  test.dof = static_cast<int>(fits.size() - 1) * static_cast<int>(n);
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Eigen::VectorXd d = values[k] - mean;
    test.statistic += d.dot(weights[k] * d);
  }
  test.p_value = p_value_of(test.statistic, test.dof);
  return test;
}

}  // namespace

WaveletVariance pool(std::span<const WaveletVariance> replicates) {
  IMUSCOPE_EXPECTS(!replicates.empty());
  WaveletVariance out;
  out.efficiency = replicates.front().efficiency;
  for (const WaveletVariance& wv : replicates) {
    IMUSCOPE_EXPECTS(!wv.segments.empty() && wv.efficiency == out.efficiency);
    for (const Segment& s : wv.segments)
      out.segments.push_back({s.begin + out.n_samples, s.end + out.n_samples});
    out.n_samples += wv.n_samples + 1;  // one sample of gap
    out.n_valid += wv.n_valid;
    for (std::size_t i = 0; i < wv.levels.size(); ++i) {
      const WvLevel& from = wv.levels[i];
      if (i == out.levels.size()) {
        out.levels.push_back(from);
        continue;
      }
      WvLevel& to = out.levels[i];
      const auto count = static_cast<double>(to.n_coefficients);
      const auto more = static_cast<double>(from.n_coefficients);
      to.value = (count * to.value + more * from.value) / (count + more);
      to.rejected_share = (count * to.rejected_share + more * from.rejected_share) / (count + more);
      to.n_coefficients += from.n_coefficients;
    }
  }
  constexpr double kConfidence = 0.95;
  set_intervals(out.levels, out.efficiency, kConfidence);
  return out;
}

Result<JointFit> fit_jointly(std::span<const WaveletVariance> replicates, const ModelSpec& spec,
                             double rate_hz, const FitOptions& options) {
  if (replicates.size() < 2) return usage_error("a joint fit needs at least two replicates");
  JointFit joint;
  auto pooled = fit(pool(replicates), spec, rate_hz, options);
  if (!pooled) return tl::unexpected(pooled.error());
  joint.pooled = std::move(*pooled);
  for (std::size_t k = 0; k < replicates.size(); ++k) {
    auto separate = fit(replicates[k], spec, rate_hz, options);
    if (!separate) {
      Error error = separate.error();
      error.what = fmt::format("replicate {}: {}", k + 1, error.what);
      return tl::unexpected(error);
    }
    joint.separate.push_back(std::move(*separate));
  }
  joint.homogeneity = homogeneity_of(joint.separate);
  return joint;
}

std::optional<JTest> distance_from_model(const WaveletVariance& window, const Model& model) {
  std::size_t levels = 0;
  while (levels < window.levels.size() && static_cast<double>(window.levels[levels].n_coefficients) >=
                                              kEnough * window.levels[levels].tau_samples) {
    ++levels;
  }
  if (levels == 0) return std::nullopt;
  const Eigen::LLT<Eigen::MatrixXd> llt(wv_covariance(model, window, levels));
  if (llt.info() != Eigen::Success) return std::nullopt;
  Eigen::VectorXd residual(static_cast<Eigen::Index>(levels));
  for (std::size_t i = 0; i < levels; ++i) {
    residual[static_cast<Eigen::Index>(i)] = window.levels[i].value - model_wv(model, window.levels[i].level);
  }
  JTest test;
  test.dof = static_cast<int>(levels);
  test.statistic = llt.matrixL().solve(residual).squaredNorm();
  test.p_value = p_value_of(test.statistic, test.dof);
  return test;
}

Model over_bounding_model(const FitResult& fit) {
  double factor = 1.0;
  for (const FittedLevel& level : fit.wv) {
    if (level.model_ci_high > 0.0 && level.fitted > 0.0)
      factor = std::max(factor, level.model_ci_high / level.fitted);
  }
  Model model = fit.model;
  for (Component& c : model.components) c.amplitude *= factor;
  return model;
}

}  // namespace imuscope::noise
