#include "models/noise/replicates.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/contracts.h"
#include "models/noise/chi_squared.h"
#include "models/noise/compare.h"
#include "models/noise/homogeneity.h"
#include "models/noise/inference.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Level of the J-test from which a model counts as explaining its samples.
constexpr double kExplained = 0.01;

/// A S A' of G-18: covariance of the model's curve at `levels` from that of its parameters.
Eigen::MatrixXd curve_covariance(const FitResult& fit, const std::vector<int>& levels) {
  const auto places = parameter_places(fit.model);
  const auto size = static_cast<Eigen::Index>(places.size());
  const auto rows = static_cast<Eigen::Index>(levels.size());
  if (static_cast<Eigen::Index>(fit.covariance.size()) != size * size)
    return Eigen::MatrixXd::Zero(rows, rows);
  const Eigen::Map<const Eigen::MatrixXd> given(fit.covariance.data(), size, size);
  const Eigen::MatrixXd known = given.array().isFinite().select(given, 0.0);
  const Eigen::MatrixXd jacobian = wv_jacobian(fit.model, levels, places);
  return jacobian * known * jacobian.transpose();
}

/// Where a replicate has the coefficients of a level, `at` samples on.
void append_places(const WaveletVariance& wv, const WvLevel& level, std::size_t at,
                   std::vector<Segment>& out) {
  for (const Segment& s : level.places) out.push_back({s.begin + at, s.end + at});
  if (!level.places.empty()) return;
  const auto support = static_cast<std::size_t>(level.tau_samples);
  for (const Segment& s : wv.segments) {
    if (s.end - s.begin >= support) out.push_back({s.begin + at + support - 1, s.end + at});
  }
}

}  // namespace

WaveletVariance pool(std::span<const WaveletVariance> replicates) {
  IMUSCOPE_EXPECTS(!replicates.empty());
  WaveletVariance out;
  out.efficiency = replicates.front().efficiency;
  std::size_t at = 0;
  for (const WaveletVariance& wv : replicates) {
    IMUSCOPE_EXPECTS(!wv.segments.empty() && wv.efficiency == out.efficiency);
    for (const Segment& s : wv.segments) out.segments.push_back({s.begin + at, s.end + at});
    out.n_samples += wv.n_samples;
    out.n_valid += wv.n_valid;
    for (std::size_t i = 0; i < wv.levels.size(); ++i) {
      const WvLevel& from = wv.levels[i];
      const bool is_first = i == out.levels.size();
      if (is_first) {
        out.levels.push_back(from);
        out.levels.back().places.clear();
      }
      WvLevel& to = out.levels[i];
      append_places(wv, from, at, to.places);
      if (is_first) continue;
      const auto count = static_cast<double>(to.n_coefficients);
      const auto more = static_cast<double>(from.n_coefficients);
      const double squares = count * to.value * to.inflation + more * from.value * from.inflation;
      to.value = (count * to.value + more * from.value) / (count + more);
      to.rejected_share = (count * to.rejected_share + more * from.rejected_share) / (count + more);
      if (to.value > 0.0) to.inflation = squares / ((count + more) * to.value);
      to.n_coefficients += from.n_coefficients;
    }
    at += 2 * wv.n_samples;  // further apart than any support bears
  }
  constexpr double kConfidence = 0.95;
  set_intervals(out.levels, out.efficiency, kConfidence);
  return out;
}

Spread spread_of(const FitResult& pooled, std::span<const WaveletVariance> replicates) {
  const Homogeneity homogeneity = test_homogeneity(replicates, pooled.model);
  Spread out;
  out.homogeneity = homogeneity.test;
  for (std::size_t p = 0; p < pooled.parameters.size(); ++p) {
    const ParameterEstimate& parameter = pooled.parameters[p];
    out.of_parameters.emplace_back();
    if (!parameter.log_sd || !(parameter.value > 0.0)) continue;
    const auto i = static_cast<Eigen::Index>(p);
    std::vector<double> steps;
    std::vector<double> variances;
    for (const UnitEstimate& unit : homogeneity.units) {
      steps.push_back(unit.step[i]);
      variances.push_back(unit.covariance(i, i));
    }
    auto effects = random_effects(steps, variances, pooled.confidence);
    if (!effects) continue;
    const double at = on_interval_scale(parameter);
    effects->mean += at;
    effects->ci_low += at;
    effects->ci_high += at;
    out.of_parameters.back() = *effects;
  }
  return out;
}

namespace {

/// Gives parameter p this sd on the scale of its interval where its own is smaller.
void widen(FitResult& fit, std::size_t p, double sd) {
  ParameterEstimate& parameter = fit.parameters[p];
  const std::size_t size = fit.parameters.size();
  if (fit.covariance.size() != size * size) return;
  const double own = std::sqrt(fit.covariance[p * size + p]);
  if (!(sd > own)) return;
  parameter.spread_sd = std::sqrt(sd * sd - own * own);
  if (parameter.sd) *parameter.sd *= sd / own;
  if (parameter.log_sd) *parameter.log_sd *= sd / own;
  for (std::size_t k = 0; k < size; ++k) {
    fit.covariance[p * size + k] *= sd / own;
    fit.covariance[k * size + p] *= sd / own;
  }
}

}  // namespace

void contain_spread(FitResult& pooled, const Spread& spread) {
  for (std::size_t p = 0; p < pooled.parameters.size(); ++p) {
    const auto& effects = spread.of_parameters[p];
    if (!effects) continue;
    ParameterEstimate& parameter = pooled.parameters[p];
    parameter.ci_low = from_interval_scale(parameter, effects->ci_low);
    parameter.ci_high = from_interval_scale(parameter, effects->ci_high);
    widen(pooled, p, effects->sd);
  }
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
  joint.spread = spread_of(joint.pooled, replicates);
  contain_spread(joint.pooled, joint.spread);
  return joint;
}

// G-18
std::optional<JTest> distance_from_model(const WaveletVariance& window, const FitResult& reference) {
  const bool explained = !reference.j_test || reference.j_test->p_value >= kExplained;
  std::vector<int> levels;
  for (std::size_t i = 0;
       i < window.levels.size() && has_enough_coefficients(window.levels[i], window.efficiency); ++i) {
    if (!explained && (i >= reference.wv.size() ||
                       !has_enough_coefficients(reference.wv[i].observed, reference.efficiency)))
      break;
    levels.push_back(window.levels[i].level);
  }
  if (levels.empty()) return std::nullopt;
  Eigen::MatrixXd v = wv_covariance(reference.model, window, levels.size());
  const Eigen::VectorXd own_variance = v.diagonal();
  v += explained ? curve_covariance(reference, levels)
                 : wv_covariance(reference.model, observed_wv(reference), levels.size());
  const Eigen::LLT<Eigen::MatrixXd> llt(v);
  if (llt.info() != Eigen::Success) return std::nullopt;
  Eigen::VectorXd residual(v.rows());
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double expected = explained ? model_wv(reference.model, levels[k]) : reference.wv[k].observed.value;
    residual[i] = near_gaussian_residual(window.levels[k].value, expected, own_variance[i]);
  }
  JTest test;
  test.dof = static_cast<int>(levels.size());
  test.statistic = llt.matrixL().solve(residual).squaredNorm();
  test.p_value = chi_squared_p_value(test.statistic, test.dof);
  return test;
}

}  // namespace imuscope::noise
