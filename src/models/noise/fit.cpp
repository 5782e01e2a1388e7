#include "models/noise/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "models/noise/chi_squared.h"
#include "models/noise/inference.h"
#include "models/noise/inverted_intervals.h"
#include "models/noise/loose_rates.h"
#include "models/noise/nested_fit.h"

namespace imuscope::noise {
namespace {

/// Runs of samples; what is apart by less than a second, as single lost samples leave it, counts as one.
std::size_t stretches_of(const std::vector<Segment>& segments, double rate_hz) {
  constexpr double kApart_s = 1.0;
  std::size_t n = segments.empty() ? 0 : 1;
  for (std::size_t i = 1; i < segments.size(); ++i)
    n += static_cast<double>(segments[i].begin - segments[i - 1].end) >= kApart_s * rate_hz ? 1 : 0;
  return n;
}

/// Level of the J-test at which the model is said not to explain the data.
constexpr double kRejected = 0.01;

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

/// Of what was observed, by the degrees of freedom that the printed model gives each level: an error of the
/// model is no error of the observation.
/// @param v  variances of the levels
void set_model_intervals(FitResult& result, const Eigen::VectorXd& v, double confidence) {
  const double tail = 0.5 * (1.0 - confidence);
  for (std::size_t i = 0; i < result.wv.size() && static_cast<Eigen::Index>(i) < v.size(); ++i) {
    FittedLevel& level = result.wv[i];
    const double variance = v[static_cast<Eigen::Index>(i)];
    const double dof = 2.0 * level.fitted * level.fitted / variance;
    if (!(dof > 0.0) || !std::isfinite(dof)) continue;
    level.model_ci_low = level.observed.value * dof / chi_squared_quantile(dof, 1.0 - tail);
    level.model_ci_high = level.observed.value * dof / chi_squared_quantile(dof, tail);
  }
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

/// A level that is further from the model than its sampling error explains.
struct Miss {
  const FittedLevel* level;
  double log_ratio;  ///< of fitted to observed
};

/// Worst first.
std::vector<Miss> missed_levels(const FitResult& result, const Eigen::MatrixXd& sampling) {
  constexpr double kSd = 2.0;
  std::vector<Miss> out;
  for (std::size_t i = 0; i < result.wv.size() && static_cast<Eigen::Index>(i) < sampling.rows(); ++i) {
    const FittedLevel& level = result.wv[i];
    const double sd = std::sqrt(sampling(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)));
    if (std::abs(level.observed.value - level.fitted) <= kSd * sd) continue;
    out.push_back({&level, std::log(level.fitted / level.observed.value)});
  }
  std::stable_sort(out.begin(), out.end(), [](const Miss& a, const Miss& b) {
    return std::abs(a.log_ratio) > std::abs(b.log_ratio);
  });
  return out;
}

/// "12 % too high", "11.6 times too low".
std::string by_how_much(double log_ratio) {
  constexpr double kFactorsFrom = 0.7;
  const char* side = log_ratio > 0.0 ? "high" : "low";
  if (std::abs(log_ratio) >= kFactorsFrom)
    return fmt::format("{:.3g} times too {}", std::exp(std::abs(log_ratio)), side);
  return fmt::format("{:.2g} % too {}", 100.0 * std::abs(std::expm1(log_ratio)), side);
}

/// Which scales are missed by how much; nothing is left out that is missed by more than what is said.
std::string misses_in_words(const FitResult& result, const Eigen::MatrixXd& sampling) {
  constexpr std::size_t kNamed = 4;
  const auto missed = missed_levels(result, sampling);
  if (missed.empty()) return ": no level alone is missed by more than twice its sampling error";
  std::string text = ": its curve is";
  for (std::size_t i = 0; i < std::min(kNamed, missed.size()); ++i) {
    const FittedLevel& level = *missed[i].level;
    text += fmt::format("{} {} at level {} ({:.3g} s)", i == 0 ? "" : ",", by_how_much(missed[i].log_ratio),
                        level.observed.level, level.observed.tau_samples / result.rate_hz);
  }
  if (missed.size() > kNamed) {
    text +=
        fmt::format(", {} at {} more at most", by_how_much(missed[kNamed].log_ratio), missed.size() - kNamed);
  }
  return text + (missed.size() == result.wv.size() ? "" : ", elsewhere within twice the sampling error");
}

void add_warnings(FitResult& result, const FixedPoint& point) {
  if (is_biased_by_quantization(result)) {
    result.warnings.emplace_back(
        "QN by a robust wavelet variance: its coefficients are not Gaussian, so that q2 and what stands "
        "beside it are biased; fit without --robust");
  }
  if (!point.settled) {
    result.warnings.emplace_back(
        "weights and model did not settle: the intervals are widened by what the levels roamed over");
  }
  if (!result.j_test || result.j_test->p_value >= kRejected) return;
  std::string text = fmt::format("{} does not explain the wavelet variance (J-test p = {:.2g})",
                                 result.spec.name(), result.j_test->p_value);
  text += misses_in_words(result, point.sampling);
  if (result.model_error > 0.0) {
    text += fmt::format(
        "; weights and intervals of the parameters allow for an error of {:.3g} % (1 sd) of every level",
        100.0 * result.model_error);
  } else {
    text += "; the intervals hold for the best model of this kind only";
  }
  result.warnings.push_back(std::move(text));
}

/// The fit by weights that do not depend on the model.
TestedPoint fit_by_interval_widths(const WaveletVariance& wv, SeparableProblem problem, const Model* start) {
  problem.whitener = interval_whitener(wv, problem.levels.size());
  const SeparableSolution found = start != nullptr ? polish(problem, *start) : find_global_minimum(problem);
  TestedPoint out;
  out.point.model = found.model;
  out.point.objective = found.objective;
  out.point.sampling = sampling_covariance(found.model, wv, problem.levels.size());
  out.point.v = out.point.sampling;
  out.test = j_test_of(wv, problem, found.model, out.point.sampling, false);
  return out;
}

}  // namespace

std::size_t fitted_levels(const WaveletVariance& wv, const FitOptions& options) {
  return options.levels > 0 ? std::min(static_cast<std::size_t>(options.levels), wv.levels.size())
                            : wv.levels.size();
}

WaveletVariance observed_wv(const FitResult& fit) {
  WaveletVariance wv;
  wv.n_samples = wv.n_valid = fit.n;
  wv.efficiency = fit.efficiency;
  for (const FittedLevel& level : fit.wv) wv.levels.push_back(level.observed);
  return wv;
}

Result<FitResult> fit(const WaveletVariance& wv, const ModelSpec& spec, double rate_hz,
                      const FitOptions& options) {
  NestedFit models(wv, fitted_levels(wv, options), options.covariances);
  return fit(wv, spec, rate_hz, options, models);
}

Result<FitResult> fit(const WaveletVariance& wv, const ModelSpec& spec, double rate_hz,
                      const FitOptions& options, NestedFit& models) {
  const std::size_t levels = fitted_levels(wv, options);
  if (auto checked = check(wv, spec, rate_hz, levels); !checked) return tl::unexpected(checked.error());
  FitResult result;
  result.n = wv.n_valid;
  result.stretches = stretches_of(wv.segments, rate_hz);
  result.rate_hz = rate_hz;
  result.spec = spec;
  result.weighting = options.weighting;
  result.confidence = options.confidence;
  result.efficiency = wv.efficiency;

  const SeparableProblem problem = unweighted_problem(wv, spec, levels);
  const bool warm = options.warm_start != nullptr && options.warm_start->spec == spec;
  const bool optimal = options.weighting == Weighting::kOptimal;
  const TestedPoint found =
      !optimal ? fit_by_interval_widths(wv, problem, warm ? &options.warm_start->model : nullptr)
      : warm   ? models.refine(spec, options.warm_start->model, options.warm_start->model_error)
               : models.solve(spec);
  const FixedPoint& point = found.point;
  result.model = point.model;
  result.objective = point.objective;
  result.model_error = point.model_error;
  result.j_test = found.test;
  for (const WvLevel& level : wv.levels)
    result.wv.push_back({level, model_wv(result.model, level.level), 0.0, 0.0});
  const Eigen::MatrixXd whitener = optimal ? whitener_of(point.v) : interval_whitener(wv, levels);
  const Eigen::MatrixXd jacobian = wv_jacobian(result.model, problem.levels, parameter_places(result.model));
  const ParameterCovariance covariance = parameter_covariance(
      jacobian, point.v, whitener.transpose() * whitener, present_parameters(result.model));
  report_parameters(result, covariance, options, problem.levels.back());
  if (optimal && whitener.size() > 0) profile_loose_rates(result, covariance, whitener);
  set_model_intervals(result, point.sampling.diagonal(), options.confidence);
  result.criterion = deviance_of(problem, result.model, point.v) +
                     std::log(static_cast<double>(levels)) * spec.parameter_count();
  if (options.intervals == Intervals::kInverted && optimal) {
    result.intervals = Intervals::kInverted;
    invert_intervals(result, wv, levels, leaning_on_loose_rates(result.model, covariance),
                     options.covariances);
  }
  add_warnings(result, point);
  return result;
}

}  // namespace imuscope::noise
