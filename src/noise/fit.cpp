#include "noise/fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "noise/chi_squared.h"
#include "noise/inference.h"
#include "noise/separable_fit.h"
#include "noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Rounds of re-weighting by the model's own covariance; they settle in 2 to 4.
constexpr int kMaxReweighting = 10;
constexpr int kUndampedRounds = 1;
constexpr double kSettledShareOfSd = 0.02;
/// Level of the J-test at which the model is said not to explain the data, and at which an error of the model
/// itself is allowed for. The second is rare enough to leave a right model's intervals alone.
constexpr double kRejected = 0.01;
constexpr double kMisfit = 0.001;
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

/// A fit on its way: the problem with its weights, its solution, and the covariance of the wavelet variance.
struct State {
  const WaveletVariance& wv;
  SeparableProblem problem;
  SeparableSolution solution;
  Eigen::MatrixXd v;
  double model_error = 0.0;  ///< share of every level

  [[nodiscard]] std::size_t levels() const { return problem.levels.size(); }
};

/// Weights from the model's own covariance, iterated. `state.solution` is the start and becomes the answer.
/// False when the rounds did not settle.
bool reweight(State& state, bool search_again) {
  for (int round = 0; round < kMaxReweighting; ++round) {
    const Eigen::MatrixXd next_v = covariance_with_ridge(state.solution.model, state.wv, state.levels());
    // Two weightings may each lead to the other: from some round on meet halfway.
    state.v = round < kUndampedRounds ? next_v : Eigen::MatrixXd(0.5 * (state.v + next_v));
    const Eigen::MatrixXd whitener = whitener_of(state.v);
    if (whitener.size() == 0) return false;
    state.problem.whitener = whitener;
    SeparableSolution next = search_again && round == 0 ? find_global_minimum(state.problem)
                                                        : polish(state.problem, state.solution.model);
    const bool done = settled(state.solution.model, next.model, state.problem.levels, state.v);
    state.solution = std::move(next);
    if (done) return true;
  }
  return false;
}

Eigen::VectorXd residual_of(const State& state) {
  Eigen::VectorXd residual = state.problem.y;
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    residual[i] -= model_wv(state.solution.model, state.problem.levels[static_cast<std::size_t>(i)]);
  }
  return residual;
}

std::vector<bool> present_parameters(const Model& model) {
  std::vector<bool> present;
  for (const ParameterPlace& place : parameter_places(model)) {
    present.push_back(model.components[place.component].amplitude > 0.0);
  }
  return present;
}

Eigen::MatrixXd jacobian_of(const State& state) {
  return wv_jacobian(state.solution.model, state.problem.levels, parameter_places(state.solution.model));
}

std::optional<JTest> test_of(const State& state) {
  return j_test(state.wv, residual_of(state), jacobian_of(state), state.v,
                present_parameters(state.solution.model));
}

/// A model that cannot follow the data is pulled to the levels with the smallest sampling errors and leaves
/// the others by factors. Here every level gets an error of the model on top, one share of its value for all,
/// as large as the residuals say. Its scale, 2 y m^2 / (y + m) for the square, makes the stationary point
/// that of the cost m/y + y/m: too high and too low by one factor weigh alike.
void allow_for_model_error(State& state, double start, bool search_again) {
  constexpr int kRounds = 40;
  constexpr int kSearchRounds = 2;
  constexpr int kCovarianceRounds =
      2;  // beside the model's error its sampling covariance need not be followed further
  constexpr double kNearEnough = 0.05;
  const double dof =
      std::max<double>(1.0, static_cast<double>(state.levels()) - state.problem.spec.parameter_count());
  double share2 = start * start;
  Eigen::MatrixXd sampling;
  Eigen::VectorXd anchor;
  if (search_again) {
    // From a solution that knows nothing of the sampling errors that misled the first one.
    state.problem.whitener = state.problem.y.cwiseInverse().asDiagonal();
    state.solution = find_global_minimum(state.problem);
  }
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::VectorXd residual = residual_of(state);
    const Eigen::VectorXd fitted = (state.problem.y - residual).cwiseMax(kRidge * state.problem.y);
    // Halfway to the new curve on the logarithm: whole steps overshoot by as much as they correct.
    anchor = round == 0 ? fitted : Eigen::VectorXd(anchor.cwiseProduct(fitted).cwiseSqrt());
    const Eigen::VectorXd scale2 =
        2.0 * state.problem.y.cwiseProduct(anchor.cwiseAbs2()).cwiseQuotient(state.problem.y + anchor);
    if (share2 <= 0.0) share2 = residual.cwiseAbs2().cwiseQuotient(scale2).sum() / dof;
    if (round < kCovarianceRounds)
      sampling = covariance_with_ridge(state.solution.model, state.wv, state.levels());
    Eigen::MatrixXd v = sampling;
    v.diagonal() += share2 * scale2;
    const Eigen::MatrixXd whitener = whitener_of(v);
    if (whitener.size() == 0) return;
    state.v = v;
    state.model_error = std::sqrt(share2);
    state.problem.whitener = whitener;
    state.solution = search_again && round < kSearchRounds ? find_global_minimum(state.problem)
                                                           : polish(state.problem, state.solution.model);
    const double excess = state.solution.objective / dof;
    if (!(excess > 0.0)) return;
    const Eigen::VectorXd now = state.problem.y - residual_of(state);
    const double moved = (now - fitted).cwiseQuotient(fitted).cwiseAbs().maxCoeff();
    if (std::abs(std::log(excess)) < kNearEnough && moved < kNearEnough) return;
    share2 *= excess;
  }
}

void set_model_intervals(FitResult& result, const Eigen::MatrixXd& v, double confidence) {
  const double tail = 0.5 * (1.0 - confidence);
  for (std::size_t i = 0; i < result.wv.size() && static_cast<Eigen::Index>(i) < v.rows(); ++i) {
    FittedLevel& level = result.wv[i];
    const double variance = v(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i));
    const double dof = 2.0 * level.fitted * level.fitted / variance;
    if (!(dof > 0.0) || !std::isfinite(dof)) continue;
    level.model_ci_low = level.observed.value * dof / chi_squared_quantile(dof, 1.0 - tail);
    level.model_ci_high = level.observed.value * dof / chi_squared_quantile(dof, tail);
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

SeparableProblem problem_of(const WaveletVariance& wv, const ModelSpec& spec, std::size_t levels,
                            bool optimal) {
  SeparableProblem problem;
  problem.spec = spec;
  problem.y.resize(static_cast<Eigen::Index>(levels));
  for (std::size_t i = 0; i < levels; ++i) {
    problem.levels.push_back(wv.levels[i].level);
    problem.y[static_cast<Eigen::Index>(i)] = wv.levels[i].value;
  }
  problem.whitener = optimal ? rough_whitener(wv, levels) : interval_whitener(wv, levels);
  return problem;
}

/// Quantization is made of uniform numbers; a robust scale is calibrated for Gaussian ones.
bool is_biased_by_quantization(const FitResult& result) {
  constexpr double kShare = 0.05;  // of the first level
  if (result.efficiency >= 1.0 || result.wv.empty()) return false;
  const FittedLevel& first = result.wv.front();
  for (const Component& c : result.model.components) {
    if (c.kind != ProcessKind::kQuantization) continue;
    return c.amplitude * unit_wv(c.kind, c.shape, first.observed.level).value > kShare * first.fitted;
  }
  return false;
}

void add_warnings(FitResult& result, bool weights_settled) {
  if (is_biased_by_quantization(result)) {
    result.warnings.emplace_back(
        "QN by a robust wavelet variance: its coefficients are not Gaussian, so that q2 and what stands "
        "beside it are "
        "biased; fit without --robust");
  }
  if (!weights_settled)
    result.warnings.emplace_back("the weights did not settle: the model is far from the data");
  if (!result.j_test || result.j_test->p_value >= kRejected) return;
  std::string text = fmt::format("{} does not explain the wavelet variance (J-test p = {:.2g})",
                                 result.spec.name(), result.j_test->p_value);
  if (result.model_error > 0.0) {
    text += fmt::format(": it passes the levels within about {:.2g} %, which weights and intervals allow for",
                        100.0 * result.model_error);
  } else {
    text += ": the intervals hold for the best model of this kind only";
  }
  result.warnings.push_back(std::move(text));
}

}  // namespace

WaveletVariance observed_wv(const FitResult& fit) {
  WaveletVariance wv;
  wv.n_samples = wv.n_valid = fit.n;
  wv.efficiency = fit.efficiency;
  for (const FittedLevel& level : fit.wv) wv.levels.push_back(level.observed);
  return wv;
}

Result<FitResult> fit(const WaveletVariance& wv, const ModelSpec& spec, double rate_hz,
                      const FitOptions& options) {
  const std::size_t levels = options.levels > 0
                                 ? std::min(static_cast<std::size_t>(options.levels), wv.levels.size())
                                 : wv.levels.size();
  if (auto checked = check(wv, spec, rate_hz, levels); !checked) return tl::unexpected(checked.error());
  FitResult result;
  result.n = wv.n_valid;
  result.rate_hz = rate_hz;
  result.spec = spec;
  result.weighting = options.weighting;
  result.confidence = options.confidence;
  result.efficiency = wv.efficiency;

  const bool optimal = options.weighting == Weighting::kOptimal;
  const bool warm = options.warm_start != nullptr && options.warm_start->spec == spec;
  State state{wv, problem_of(wv, spec, levels, optimal), {}, {}};
  if (!warm) {
    state.solution = find_global_minimum(state.problem);
  } else if (optimal) {
    state.solution.model = options.warm_start->model;  // its own covariance gives the first weights
  } else {
    state.solution = polish(state.problem, options.warm_start->model);
  }
  const bool known_misfit = warm && optimal && options.warm_start->model_error > 0.0;
  bool weights_settled = !optimal || known_misfit || reweight(state, !warm);
  if (state.v.size() == 0) state.v = covariance_with_ridge(state.solution.model, wv, levels);
  result.j_test = test_of(state);
  const auto misfit = [&] { return optimal && result.j_test && result.j_test->p_value < kMisfit; };
  if (known_misfit && !misfit()) {
    weights_settled = reweight(state, false);
    result.j_test = test_of(state);
  }
  if (misfit()) {
    weights_settled = true;
    allow_for_model_error(state, known_misfit ? options.warm_start->model_error : 0.0, !warm);
  }
  result.model = state.solution.model;
  result.objective = state.solution.objective;
  result.model_error = state.model_error;
  for (const WvLevel& level : wv.levels)
    result.wv.push_back({level, model_wv(result.model, level.level), 0.0, 0.0});
  const Eigen::MatrixXd omega = state.problem.whitener.transpose() * state.problem.whitener;
  report_parameters(
      result, parameter_covariance(jacobian_of(state), state.v, omega, present_parameters(result.model)),
      options, state.problem.levels.back());
  set_model_intervals(result, state.v, options.confidence);
  result.criterion = criterion_of(state.problem, residual_of(state), state.v);
  add_warnings(result, weights_settled);
  return result;
}

}  // namespace imuscope::noise
