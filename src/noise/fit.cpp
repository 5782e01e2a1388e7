#include "noise/fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>

#include "noise/inference.h"
#include "noise/separable_fit.h"
#include "noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Rounds of re-weighting by the model's own covariance; they settle in 2 to 4.
constexpr int kMaxReweighting = 10;
constexpr int kUndampedRounds = 1;
constexpr double kSettledShareOfSd = 0.02;
/// Level of the J-test at which the model is said not to explain the data.
constexpr double kRejected = 0.01;
/// Added to the diagonal of the covariance, relative: an exact ramp has none of its own.
constexpr double kRidge = 1e-10;

Result<void> check(const WaveletVariance& wv, const ModelSpec& spec, double rate_hz, std::size_t levels) {
  if (!(rate_hz > 0.0) || !std::isfinite(rate_hz)) {
    return usage_error(fmt::format("a rate of {} Hz is impossible", rate_hz), "give the samples per second");
  }
  if (spec.processes.empty()) return usage_error("the model has no terms");
  if (spec.processes.size() > static_cast<std::size_t>(kMaxColumns) ||
      wv.levels.size() > static_cast<std::size_t>(kMaxRows)) {
    return usage_error(
        fmt::format("the model {} has too many terms or the signal too many levels", spec.name()));
  }
  if (static_cast<int>(levels) < spec.parameter_count()) {
    return work_error(fmt::format("the model {} has {} parameters and the wavelet variance {} levels",
                                  spec.name(), spec.parameter_count(), levels),
                      "use a simpler model or a longer signal");
  }
  for (std::size_t i = 0; i < levels; ++i) {
    if (!(wv.levels[i].value > 0.0)) {
      return work_error(fmt::format("the wavelet variance of level {} is {}: the signal is constant there",
                                    i + 1, wv.levels[i].value),
                        "a noise model needs a signal that varies");
    }
  }
  return {};
}

std::vector<double> fitted_curve(const Model& model, const std::vector<int>& levels) {
  std::vector<double> curve;
  for (const int level : levels) curve.push_back(model_wv(model, level));
  return curve;
}

/// Diagonal whitener 1 / (interval width).
Eigen::MatrixXd interval_whitener(const WaveletVariance& wv, std::size_t levels) {
  Eigen::VectorXd d(static_cast<Eigen::Index>(levels));
  for (std::size_t i = 0; i < levels; ++i) {
    d[static_cast<Eigen::Index>(i)] = 1.0 / (wv.levels[i].ci_high - wv.levels[i].ci_low);
  }
  return d.asDiagonal();
}

/// Diagonal whitener from the equivalent degrees of freedom that most processes roughly have, 2 M_j / 2^j.
Eigen::MatrixXd rough_whitener(const WaveletVariance& wv, std::size_t levels) {
  Eigen::VectorXd d(static_cast<Eigen::Index>(levels));
  for (std::size_t i = 0; i < levels; ++i) {
    const WvLevel& level = wv.levels[i];
    const double dof = 2.0 * std::max(static_cast<double>(level.n_coefficients) / level.tau_samples, 0.5);
    d[static_cast<Eigen::Index>(i)] = std::sqrt(0.5 * dof) / level.value;
  }
  return d.asDiagonal();
}

Eigen::MatrixXd covariance_with_ridge(const Model& model, const WaveletVariance& wv, std::size_t levels) {
  Eigen::MatrixXd v = wv_covariance(model, wv, levels);
  for (Eigen::Index i = 0; i < v.rows(); ++i) {
    const double value = model_wv(model, wv.levels[static_cast<std::size_t>(i)].level);
    v(i, i) += kRidge * (v(i, i) + kRidge * value * value);
  }
  return v;
}

/// L^-1 of v = L L'; empty when v is not positive definite.
Eigen::MatrixXd whitener_of(const Eigen::MatrixXd& v) {
  const Eigen::LLT<Eigen::MatrixXd> llt(v);
  if (llt.info() != Eigen::Success) return {};
  return llt.matrixL().solve(Eigen::MatrixXd::Identity(v.rows(), v.cols()));
}

/// No fitted level moved by more than a small part of its own sd.
bool settled(const Model& before, const Model& after, const std::vector<int>& levels,
             const Eigen::MatrixXd& v) {
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const double sd = std::sqrt(v(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)));
    if (std::abs(model_wv(after, levels[i]) - model_wv(before, levels[i])) > kSettledShareOfSd * sd)
      return false;
  }
  return true;
}

/// Weights from the model's own covariance, iterated. `solution` is the start and becomes the answer; `v` the
/// covariance that its weights are the inverse of. False when the rounds did not settle.
bool reweight(SeparableProblem& problem, const WaveletVariance& wv, SeparableSolution& solution,
              Eigen::MatrixXd& v, bool search_again) {
  for (int round = 0; round < kMaxReweighting; ++round) {
    const Eigen::MatrixXd next_v = covariance_with_ridge(solution.model, wv, problem.levels.size());
    // Two weightings may each lead to the other: from some round on meet halfway.
    v = round < kUndampedRounds ? next_v : Eigen::MatrixXd(0.5 * (v + next_v));
    const Eigen::MatrixXd whitener = whitener_of(v);
    if (whitener.size() == 0) return false;
    problem.whitener = whitener;
    SeparableSolution next =
        search_again && round == 0 ? find_global_minimum(problem) : polish(problem, solution.model);
    const bool done = settled(solution.model, next.model, problem.levels, v);
    solution = std::move(next);
    if (done) return true;
  }
  return false;
}

void set_model_intervals(FitResult& result, const Eigen::MatrixXd& v, double confidence) {
  const double tail = 0.5 * (1.0 - confidence);
  for (std::size_t i = 0; i < result.wv.size() && static_cast<Eigen::Index>(i) < v.rows(); ++i) {
    FittedLevel& level = result.wv[i];
    const double variance = v(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i));
    const double dof = 2.0 * level.fitted * level.fitted / variance;
    if (!(dof > 0.0) || !std::isfinite(dof)) continue;
    const boost::math::chi_squared distribution(dof);
    level.model_ci_low = level.observed.value * dof / boost::math::quantile(distribution, 1.0 - tail);
    level.model_ci_high = level.observed.value * dof / boost::math::quantile(distribution, tail);
  }
}

/// Twice the negative Gaussian log-likelihood of the wavelet variance under the model, in units of the
/// observed values, plus ln(levels) for each parameter (Schwarz).
double criterion_of(const SeparableProblem& problem, const Eigen::VectorXd& residual,
                    const Eigen::MatrixXd& v) {
  const Eigen::VectorXd scale = problem.y.cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> llt(scale.asDiagonal() * v * scale.asDiagonal());
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd factor = llt.matrixL();
  return llt.matrixL().solve(scale.cwiseProduct(residual)).squaredNorm() +
         2.0 * factor.diagonal().array().log().sum() +
         std::log(static_cast<double>(residual.size())) * problem.spec.parameter_count();
}

std::vector<bool> present_parameters(const Model& model) {
  std::vector<bool> present;
  for (const ParameterPlace& place : parameter_places(model)) {
    present.push_back(model.components[place.component].amplitude > 0.0);
  }
  return present;
}

}  // namespace

Result<FitResult> fit(const WaveletVariance& wv, const ModelSpec& spec, double rate_hz,
                      const FitOptions& options) {
  const std::size_t levels = options.levels > 0
                                 ? std::min(static_cast<std::size_t>(options.levels), wv.levels.size())
                                 : wv.levels.size();
  if (auto checked = check(wv, spec, rate_hz, levels); !checked) return tl::unexpected(checked.error());

  SeparableProblem problem;
  problem.spec = spec;
  problem.y.resize(static_cast<Eigen::Index>(levels));
  for (std::size_t i = 0; i < levels; ++i) {
    problem.levels.push_back(wv.levels[i].level);
    problem.y[static_cast<Eigen::Index>(i)] = wv.levels[i].value;
  }
  const bool optimal = options.weighting == Weighting::kOptimal;
  problem.whitener = optimal ? rough_whitener(wv, levels) : interval_whitener(wv, levels);
  const bool warm = options.warm_start != nullptr && options.warm_start->spec == spec;
  SeparableSolution solution;
  if (!warm) {
    solution = find_global_minimum(problem);
  } else if (optimal) {
    solution.model = options.warm_start->model;  // its own covariance gives the first weights
  } else {
    solution = polish(problem, options.warm_start->model);
  }
  Eigen::MatrixXd v;
  const bool weights_settled = !optimal || reweight(problem, wv, solution, v, !warm);
  if (!optimal || v.size() == 0) v = covariance_with_ridge(solution.model, wv, levels);

  FitResult result;
  result.n = wv.n_valid;
  result.rate_hz = rate_hz;
  result.spec = spec;
  result.weighting = options.weighting;
  result.model = solution.model;
  result.objective = solution.objective;
  for (const WvLevel& level : wv.levels)
    result.wv.push_back({level, model_wv(result.model, level.level), 0.0, 0.0});

  const auto places = parameter_places(result.model);
  const Eigen::MatrixXd jacobian = wv_jacobian(result.model, problem.levels, places);
  const auto present = present_parameters(result.model);
  const Eigen::MatrixXd omega = problem.whitener.transpose() * problem.whitener;
  const auto curve = fitted_curve(result.model, problem.levels);
  const Eigen::VectorXd residual =
      problem.y - Eigen::Map<const Eigen::VectorXd>(curve.data(), static_cast<Eigen::Index>(curve.size()));
  report_parameters(result, parameter_covariance(jacobian, v, omega, present), options,
                    problem.levels.back());
  result.j_test = j_test(wv, residual, jacobian, v, present);
  set_model_intervals(result, v, options.confidence);
  result.criterion = criterion_of(problem, residual, v);
  if (!weights_settled)
    result.warnings.emplace_back("the weights did not settle: the model is far from the data");
  if (result.j_test && result.j_test->p_value < kRejected) {
    result.warnings.push_back(
        fmt::format("{} does not explain the wavelet variance (J-test p = {:.2g}): the intervals "
                    "hold for the best model of this kind only",
                    spec.name(), result.j_test->p_value));
  }
  return result;
}

}  // namespace imuscope::noise
