#include "models/certificate/units.h"

#include <algorithm>
#include <boost/math/distributions/non_central_t.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <map>

#include "models/noise/holm.h"

namespace imuscope::certificate {
namespace {

/// A value and its error on the logarithm.
struct Estimate {
  double log_value = 0.0;
  double log_sd = 0.0;
};

std::optional<Estimate> estimate_of(const TermValue& term, double z) {
  if (term.knowledge != noise::Knowledge::kFitted || !(term.value > 0.0)) return std::nullopt;
  if (!term.ci_low || !term.ci_high || !(*term.ci_low > 0.0)) return std::nullopt;
  return Estimate{std::log(term.value), std::log(*term.ci_high / *term.ci_low) / (2.0 * z)};
}

/// T-3: p of each value's deviation from the others, by Student's t of the value left out.
std::vector<std::optional<double>> deviations(const std::vector<Estimate>& estimates) {
  const auto n = static_cast<double>(estimates.size());
  constexpr std::size_t kFewest = 4;  // three others tell a spread
  std::vector<std::optional<double>> p(estimates.size());
  if (estimates.size() < kFewest) return p;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    double mean = 0.0;
    for (std::size_t k = 0; k < estimates.size(); ++k) {
      if (k != i) mean += estimates[k].log_value / (n - 1.0);
    }
    double squares = 0.0;
    for (std::size_t k = 0; k < estimates.size(); ++k) {
      if (k != i) squares += (estimates[k].log_value - mean) * (estimates[k].log_value - mean);
    }
    const double variance = squares / (n - 2.0) * (1.0 + 1.0 / (n - 1.0));
    if (!(variance > 0.0)) continue;
    const double t = std::abs(estimates[i].log_value - mean) / std::sqrt(variance);
    p[i] = 2.0 * boost::math::cdf(boost::math::complement(boost::math::students_t(n - 2.0), t));
  }
  return noise::holm_adjusted(p);
}

Population population_of_term(const std::string& axis, Term term, const std::vector<const TermValue*>& values,
                              double confidence) {
  Population out;
  out.axis = axis;
  out.term = term;
  const double z = boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + confidence));
  std::vector<Estimate> estimates;
  std::vector<std::size_t> place;
  out.values.resize(values.size());
  out.p_values.resize(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] == nullptr) continue;
    out.unit = values[i]->unit;
    const auto estimate = estimate_of(*values[i], z);
    if (!estimate) continue;
    out.values[i] = values[i]->value;
    estimates.push_back(*estimate);
    place.push_back(i);
  }
  out.n = estimates.size();
  if (out.n < 2) return out;
  std::vector<double> x;
  std::vector<double> variance;
  double mean = 0.0;
  for (const Estimate& e : estimates) {
    x.push_back(e.log_value);
    variance.push_back(std::max(e.log_sd * e.log_sd, 1e-12));
    mean += e.log_value / static_cast<double>(out.n);
  }
  out.effects = noise::random_effects(x, variance, confidence);
  if (out.n >= 3) {
    double squares = 0.0;
    for (const double v : x) squares += (v - mean) * (v - mean);
    // The sd of the values as measured: their own errors are in it, on the safe side.
    const double sd = std::sqrt(squares / static_cast<double>(out.n - 1));
    constexpr double kShare = 0.95;
    out.tolerance_upper = std::exp(mean + tolerance_factor(out.n, kShare, confidence) * sd);
  }
  const auto p = deviations(estimates);
  for (std::size_t k = 0; k < p.size(); ++k) out.p_values[place[k]] = p[k];
  return out;
}

}  // namespace

// T-3: k
double tolerance_factor(std::size_t n, double share, double confidence) {
  const auto count = static_cast<double>(n);
  const double z = boost::math::quantile(boost::math::normal(), share);
  const boost::math::non_central_t t(count - 1.0, z * std::sqrt(count));
  return boost::math::quantile(t, confidence) / std::sqrt(count);
}

std::vector<Population> population_of(std::span<const std::vector<AxisCertificate>> records,
                                      double confidence) {
  // In the order in which the first record names them.
  std::vector<std::pair<std::string, Term>> rows;
  std::map<std::pair<std::string, Term>, std::vector<const TermValue*>> values;
  for (std::size_t r = 0; r < records.size(); ++r) {
    for (const AxisCertificate& axis : records[r]) {
      for (const TermValue& term : axis.terms) {
        const std::pair key{axis.name, term.term};
        auto& row = values[key];
        if (row.empty()) {
          row.resize(records.size(), nullptr);
          rows.push_back(key);
        }
        row[r] = &term;
      }
    }
  }
  std::vector<Population> out;
  for (const auto& key : rows) {
    Population population = population_of_term(key.first, key.second, values[key], confidence);
    if (population.n >= 2) out.push_back(std::move(population));
  }
  return out;
}

}  // namespace imuscope::certificate
