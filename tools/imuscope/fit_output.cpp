#include "fit_output.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "models/noise/json.h"
#include "print.h"

namespace imuscope::cli {
namespace {

/// Below this the replicates are not taken for one process.
constexpr double kHomogeneous = 0.05;

std::string interval(const std::optional<double>& low, const std::optional<double>& high) {
  if (low && high) return fmt::format("[{:.6g}, {:.6g}]", *low, *high);
  if (high) return fmt::format("below {:.6g}", *high);
  return low ? fmt::format("above {:.6g}", *low) : "-";
}

std::string interval_heading(const noise::FitResult& fit) {
  return fmt::format("{:g} % interval", 100.0 * fit.confidence);
}

std::string p_value(const std::optional<noise::JTest>& test) {
  return test ? fmt::format("{:.3g}", test->p_value) : "-";
}

void print_parameters(const noise::FitResult& fit) {
  say("{:<7} {:<10} {:>14} {:>14}  {:<30} {}\n", "process", "parameter", "value", "sd", interval_heading(fit),
      "unit");
  for (const auto& p : fit.parameters) {
    say("{:<7} {:<10} {:>14.7g} {:>14}  {:<30} {}\n", p.process, p.name, p.value,
        p.sd ? fmt::format("{:.4g}", *p.sd) : "-", interval(p.ci_low, p.ci_high), p.unit);
  }
}

void print_quantities(const noise::FitResult& fit, const std::vector<noise::Quantity>& quantities) {
  say("\n{:<7} {:<26} {:>14}  {:<30} {}\n", "process", "for filter and data sheet", "value",
      interval_heading(fit), "unit");
  for (const auto& q : quantities) {
    const std::string range = q.knowledge == noise::Knowledge::kBound     ? "at most"
                              : q.knowledge == noise::Knowledge::kUnknown ? "not known from this record"
                                                                          : interval(q.ci_low, q.ci_high);
    const std::string value =
        q.knowledge == noise::Knowledge::kUnknown ? "-" : fmt::format("{:.7g}", q.value);
    say("{:<7} {:<26} {:>14}  {:<30} {}\n", q.process, q.name, value, range, q.unit);
  }
}

void print_levels(const noise::FitResult& fit) {
  say("\n{:>5} {:>12} {:>13} {:>13}  {} under the model\n", "level", "tau_s", "wv", "fitted",
      interval_heading(fit));
  for (const auto& level : fit.wv) {
    const bool known = level.model_ci_high > 0.0;
    say("{:>5} {:>12.6g} {:>13.6g} {:>13.6g}  {}\n", level.observed.level,
        level.observed.tau_samples / fit.rate_hz, level.observed.value, level.fitted,
        known ? fmt::format("[{:.6g}, {:.6g}]", level.model_ci_low, level.model_ci_high) : "-");
  }
}

nlohmann::json test_json(const std::optional<noise::JTest>& test) {
  if (!test) return nullptr;
  return {{"statistic", test->statistic}, {"dof", test->dof}, {"p_value", test->p_value}};
}

}  // namespace

void print_fit(const noise::FitResult& fit, noise::SignalUnit unit) {
  say("model {}   n {}   rate {:g} Hz   weights {}{}\n\n", fit.spec.name(), fit.n, fit.rate_hz,
      fit.weighting == noise::Weighting::kCi ? "ci" : "optimal",
      fit.efficiency < 1.0 ? fmt::format("   robust, efficiency {:g}", fit.efficiency) : "");
  print_parameters(fit);
  print_quantities(fit, noise::filter_quantities(fit, unit));
  print_levels(fit);
  say("\nobjective {:.8g}", fit.objective);
  if (fit.j_test) {
    say("   J-test {:.4g} on {} dof, p = {:.3g}", fit.j_test->statistic, fit.j_test->dof,
        fit.j_test->p_value);
  }
  say("\n{}\n", fit.identifiable ? "identifiable" : "not identifiable");
  for (const auto& warning : fit.warnings) say("! {}\n", warning);
}

void print_conservative(const noise::FitResult& bound, noise::SignalUnit unit) {
  say("\nover-bounding model, above the upper interval end of every level with enough coefficients\n\n");
  print_parameters(bound);
  print_quantities(bound, noise::over_bounding_quantities(bound, unit));
}

void print_ranking(const std::vector<noise::RankedModel>& ranked) {
  say("{:<4} {:<20} {:>12} {:>12}  {}\n", "rank", "model", "criterion", "J p-value", "why");
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    const auto& m = ranked[i];
    say("{:<4} {:<20} {:>12.5g} {:>12}  {}\n", i + 1, m.fit.spec.name(), m.criterion, p_value(m.fit.j_test),
        m.reason);
  }
  say("\n");
}

void print_ranking(const std::vector<noise::CrossValidated>& ranked) {
  say("{:<4} {:<20} {:>12} {:>12}  {}\n", "rank", "model", "CV-WVIC", "J p-value", "why");
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    const auto& m = ranked[i];
    say("{:<4} {:<20} {:>12.5g} {:>12}  {}\n", i + 1, m.pooled.spec.name(), m.score, p_value(m.pooled.j_test),
        m.reason);
  }
  say("\n");
}

void print_replicates(const noise::JointFit& joint) {
  say("\n{:<7} {:<10} {:>14}", "process", "parameter", "together");
  for (std::size_t k = 0; k < joint.separate.size(); ++k) say(" {:>14}", fmt::format("replicate {}", k + 1));
  say("\n");
  for (std::size_t p = 0; p < joint.pooled.parameters.size(); ++p) {
    const auto& pooled = joint.pooled.parameters[p];
    say("{:<7} {:<10} {:>14.6g}", pooled.process, pooled.name, pooled.value);
    for (const auto& fit : joint.separate) say(" {:>14.6g}", fit.parameters[p].value);
    say("\n");
  }
  say("\n{:<7} {:<10} {:>16}  {}\n", "process", "parameter", "spread, sd of log",
      interval_heading(joint.pooled));
  for (std::size_t p = 0; p < joint.pooled.parameters.size(); ++p) {
    const auto& parameter = joint.pooled.parameters[p];
    if (const auto& spread = joint.spread.of_parameters[p])
      say("{:<7} {:<10} {:>16.4g}  [{:.4g}, {:.4g}]\n", parameter.process, parameter.name, spread->spread,
          spread->spread_low, spread->spread_high);
  }
  if (!joint.spread.homogeneity) {
    say("\nno test of near-stationarity: no parameter is in use\n");
    return;
  }
  const auto& test = *joint.spread.homogeneity;
  say("\nnear-stationarity: {:.4g} on {} dof, p = {:.3g}: {}\n", test.statistic, test.dof, test.p_value,
      test.p_value < kHomogeneous
          ? "the replicates differ by more than their uncertainty; the intervals contain that"
          : "the replicates may be one process");
}

nlohmann::json conservative_json(const noise::FitResult& bound, noise::SignalUnit unit) {
  return {{"parameters", noise::fit_to_json(bound).at("parameters")},
          {"quantities", noise::quantities_to_json(noise::over_bounding_quantities(bound, unit))}};
}

nlohmann::json ranking_json(const std::vector<noise::CrossValidated>& ranked) {
  auto json = nlohmann::json::array();
  for (const auto& m : ranked) {
    json.push_back(
        {{"model", m.pooled.spec.name()},
         {"cv_wvic", m.score},
         {"worse_by", m.worse_by},
         {"worse_by_sd", m.worse_by_sd},
         {"identifiable", m.pooled.identifiable},
         {"p_value", m.pooled.j_test ? nlohmann::json(m.pooled.j_test->p_value) : nlohmann::json()},
         {"reason", m.reason}});
  }
  return json;
}

nlohmann::json replicates_json(const noise::JointFit& joint, noise::SignalUnit unit) {
  nlohmann::json json{{"replicates", nlohmann::json::array()},
                      {"homogeneity", test_json(joint.spread.homogeneity)}};
  for (const auto& fit : joint.separate) json["replicates"].push_back(noise::fit_to_json(fit, unit));
  json["spread"] = nlohmann::json::array();
  for (std::size_t p = 0; p < joint.pooled.parameters.size(); ++p) {
    const auto& parameter = joint.pooled.parameters[p];
    nlohmann::json row{{"process", parameter.process}, {"name", parameter.name}, {"log_sd", nullptr}};
    if (const auto& spread = joint.spread.of_parameters[p]) {
      row["log_sd"] = spread->spread;
      row["ci_low"] = spread->spread_low;
      row["ci_high"] = spread->spread_high;
    }
    json["spread"].push_back(std::move(row));
  }
  return json;
}

}  // namespace imuscope::cli
