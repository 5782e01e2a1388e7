#include "models/noise/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

#include "models/noise/chi_squared.h"
#include "models/noise/homogeneity.h"
#include "models/noise/inference.h"
#include "models/noise/parameter_scale.h"

namespace imuscope::noise {
namespace {

double covariance_of(const FitResult& fit, std::size_t i, std::size_t k) {
  const std::size_t size = fit.parameters.size();
  return fit.covariance.size() == size * size ? fit.covariance[i * size + k] : std::nan("");
}

std::optional<std::size_t> index_of(const FitResult& fit, const ParameterEstimate& p) {
  const auto at = std::find_if(fit.parameters.begin(), fit.parameters.end(), [&](const ParameterEstimate& q) {
    return q.process == p.process && q.name == p.name;
  });
  if (at == fit.parameters.end()) return std::nullopt;
  return static_cast<std::size_t>(at - fit.parameters.begin());
}

/// Whether one of the records is too short for the process that the other one shows. Its own estimate is
/// determined then only where chance made its rate large, and would differ from the other's for that alone.
bool is_too_short_for_the_other(const FitResult& first, const FitResult& second, const std::string& process) {
  const auto rate_of = [&](const FitResult& fit) -> std::optional<double> {
    for (const ParameterEstimate& p : fit.parameters) {
      if (p.process == process && p.name == "beta") return p.value;
    }
    return std::nullopt;
  };
  const auto is_short = [](const FitResult& fit, const std::optional<double>& beta) {
    return beta && *beta * static_cast<double>(fit.n) < kFewestCorrelationTimes * fit.rate_hz;
  };
  return is_short(first, rate_of(second)) || is_short(second, rate_of(first));
}

/// Both wavelet variances as one, level by level.
WaveletVariance together(const FitResult& a, const FitResult& b) {
  WaveletVariance out = observed_wv(a.wv.size() >= b.wv.size() ? a : b);
  const WaveletVariance less = observed_wv(a.wv.size() >= b.wv.size() ? b : a);
  out.n_samples += less.n_samples;
  out.n_valid += less.n_valid;
  for (std::size_t i = 0; i < less.levels.size(); ++i) {
    WvLevel& to = out.levels[i];
    const WvLevel& from = less.levels[i];
    const auto count = static_cast<double>(to.n_coefficients);
    const auto more = static_cast<double>(from.n_coefficients);
    to.value = (count * to.value + more * from.value) / (count + more);
    to.n_coefficients += from.n_coefficients;
    to.places.clear();
  }
  return out;
}

/// Whether both records come from one model, that of more terms: a test of the levels, whose size does not
/// hang on how far from Gaussian the estimates are. Both are in one unit.
std::optional<DifferenceTest> joint_test(const FitResult& a, const FitResult& b) {
  if (a.rate_hz != b.rate_hz || a.efficiency != b.efficiency) return std::nullopt;
  const ModelSpec& spec = b.spec.parameter_count() > a.spec.parameter_count() ? b.spec : a.spec;
  const auto common = fit(together(a, b), spec, a.rate_hz);
  if (!common) return std::nullopt;
  const std::array records{observed_wv(a), observed_wv(b)};
  const std::array errors{a.model_error, b.model_error};
  const auto test = test_homogeneity(records, common->model, errors).test;
  if (!test) return std::nullopt;
  return DifferenceTest{test->statistic, test->dof, test->p_value};
}

/// @param sd  of the difference on the scale of the intervals
void set_ratio_interval(ComparedParameter& row, double sd, double z) {
  const ParameterScale scale = parameter_scale_of(row.name);
  if (!row.ratio || !is_logarithmic(scale)) return;
  const double log_sd = scale == ParameterScale::kLogSquare ? 0.5 * sd : sd;
  row.ratio_ci_low = *row.ratio * std::exp(-z * log_sd);
  row.ratio_ci_high = *row.ratio * std::exp(z * log_sd);
}

}  // namespace

double on_interval_scale(const ParameterEstimate& p) { return to_scale(parameter_scale_of(p.name), p.value); }

double from_interval_scale(const ParameterEstimate& p, double place) {
  return from_scale(parameter_scale_of(p.name), place);
}

Comparison compare(const FitResult& first, const FitResult& second) {
  Comparison out;
  bool has_common = false;
  bool in_one_unit = true;
  const double z = boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + first.confidence));
  for (std::size_t i = 0; i < first.parameters.size(); ++i) {
    const ParameterEstimate& p = first.parameters[i];
    ComparedParameter row;
    row.process = p.process;
    row.name = p.name;
    row.unit = p.unit;
    row.first = p.value;
    if (const auto k = index_of(second, p)) {
      const ParameterEstimate& q = second.parameters[*k];
      row.second = q.value;
      if (p.value != 0.0) row.ratio = q.value / p.value;
      if (p.unit != q.unit) {
        in_one_unit = false;
        out.warnings.push_back(
            fmt::format("{} {} is in '{}' and in '{}': not compared", p.process, p.name, p.unit, q.unit));
      } else if (is_too_short_for_the_other(first, second, p.process)) {
        if (p.name == "beta") {
          out.warnings.push_back(fmt::format(
              "{}: one record is shorter than {:.0f} correlation times of what the other shows: not compared",
              p.process, kFewestCorrelationTimes));
        }
      } else if (const double variance = covariance_of(first, i, i) + covariance_of(second, *k, *k);
                 std::isfinite(variance) && variance > 0.0) {
        const double d = on_interval_scale(q) - on_interval_scale(p);
        row.p_value = chi_squared_p_value(d * d / variance, 1);
        set_ratio_interval(row, std::sqrt(variance), z);
        has_common = true;
      }
    }
    out.parameters.push_back(row);
  }
  for (const ParameterEstimate& q : second.parameters) {
    if (index_of(first, q)) continue;
    ComparedParameter row;
    row.process = q.process;
    row.name = q.name;
    row.unit = q.unit;
    row.second = q.value;
    out.parameters.push_back(row);
  }
  if (!(first.spec == second.spec)) {
    out.warnings.push_back(
        fmt::format("the models differ ({} and {}): a term of one may stand for several of the other",
                    first.spec.name(), second.spec.name()));
  }
  if (first.rate_hz != second.rate_hz) {
    out.warnings.push_back(
        fmt::format("the rates differ ({} and {} Hz): WN, RW, QN and DR parameters are per sample",
                    first.rate_hz, second.rate_hz));
  }
  if (has_common && in_one_unit) out.test = joint_test(first, second);
  return out;
}

}  // namespace imuscope::noise
