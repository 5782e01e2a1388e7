#include "models/noise/json.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>

#include "models/noise/parameter_scale.h"

namespace imuscope::noise {
namespace {

using nlohmann::json;

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }
json number(const std::optional<double>& value) { return value ? number(*value) : json(nullptr); }

json level_to_json(const WvLevel& level, double rate_hz) {
  json row{{"level", level.level},
           {"tau_s", level.tau_samples / rate_hz},
           {"value", number(level.value)},
           {"ci_low", number(level.ci_low)},
           {"ci_high", number(level.ci_high)},
           {"n_coefficients", level.n_coefficients}};
  if (level.inflation != 1.0) row["inflation"] = level.inflation;
  return row;
}

double number_or_nan(const json& j) {
  return j.is_null() ? std::numeric_limits<double>::quiet_NaN() : j.get<double>();
}

std::optional<double> optional_number(const json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end() || at->is_null()) return std::nullopt;
  return at->get<double>();
}

/// A number of a document that anybody may have written.
std::optional<double> number_if_any(const json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end() || !at->is_number()) return std::nullopt;
  return at->get<double>();
}

/// ", without lines at 21.3, 0.4 Hz"; empty where none were taken out.
std::string lines_in_words(const json& entry) {
  std::string words;
  const auto sinusoids = entry.find("sinusoids");
  if (sinusoids == entry.end() || !sinusoids->is_array()) return words;
  for (const json& line : *sinusoids) {
    const auto parameters = line.is_object() ? line.find("parameters") : line.end();
    if (parameters == line.end() || !parameters->is_array()) continue;
    for (const json& p : *parameters) {
      if (!p.is_object() || p.value("name", json()) != "frequency") continue;
      if (const auto frequency_hz = number_if_any(p, "value"))
        words += fmt::format("{} {:.4g}", words.empty() ? ", without lines at" : ",", *frequency_hz);
    }
  }
  return words.empty() ? words : words + " Hz";
}

/// The component's value that a printed parameter stands for, back in sample terms.
void set_parameter(Component& c, const ParameterEstimate& p, double rate_hz) {
  if (p.name == "beta" || p.name == "damping") {
    c.shape[0] = p.value / rate_hz;
  } else if (p.name == "frequency") {
    c.shape[c.kind == ProcessKind::kResonance ? 1 : 0] = 2.0 * std::numbers::pi * p.value / rate_hz;
  } else if (p.name == "exponent" || p.name == "phi") {
    c.shape[0] = p.value;
  } else if (p.name == "theta") {
    c.shape[c.kind == ProcessKind::kArma11 ? 1 : 0] = p.value;
  } else if (parameter_scale_of(p.name) == ParameterScale::kLogSquare) {
    c.amplitude = p.value * p.value;
  } else {
    c.amplitude = p.value;
  }
}

Model model_from_parameters(const ModelSpec& spec, const std::vector<ParameterEstimate>& parameters,
                            double rate_hz) {
  Model model;
  std::size_t p = 0;
  for (const ProcessKind kind : spec.processes) {
    Component c{kind, 0.0, {}};
    for (int i = 0; i <= shape_count(kind); ++i) set_parameter(c, parameters.at(p++), rate_hz);
    if (!is_in_range(kind, c.shape))
      throw std::invalid_argument(fmt::format("a parameter of {} is out of its range", short_name(kind)));
    model.components.push_back(c);
  }
  return model;
}

/// Under which names the values of a process are printed: its shapes, then its amplitude.
std::vector<std::string> value_names(ProcessKind kind) {
  switch (kind) {
    case ProcessKind::kQuantization:
      return {"q2"};
    case ProcessKind::kMa1:
      return {"theta", "sigma2"};
    case ProcessKind::kArma11:
      return {"phi", "theta", "sigma2"};
    case ProcessKind::kSinusoid:
      return {"frequency", "alpha"};
    case ProcessKind::kResonance:
      return {"damping", "frequency", "sigma2"};
    case ProcessKind::kGaussMarkov:
      return {"beta", "sigma2"};
    case ProcessKind::kFlicker:
      return {"B"};
    case ProcessKind::kPowerLaw:
      return {"exponent", "sigma2"};
    case ProcessKind::kRandomWalk:
      return {"gamma2"};
    case ProcessKind::kRamp:
      return {"omega"};
    case ProcessKind::kWhiteNoise:
      break;
  }
  return {"sigma2"};
}

/// One process with its values; of those that are wrong the first.
Result<Component> component_of(ProcessKind kind, const std::string& name, const ProcessValues& values,
                               double rate_hz) {
  const auto names = value_names(kind);
  const std::string remedy = fmt::format("{} has {}", name, fmt::join(names, ", "));
  for (const auto& [key, value] : values) {
    if (std::find(names.begin(), names.end(), key) == names.end())
      return usage_error(fmt::format("{} has no value {}", name, key), remedy);
    if (!std::isfinite(value)) return usage_error(fmt::format("{} of {} is not finite", key, name), {});
  }
  Component c{kind, 0.0, {}};
  for (const std::string& wanted : names) {
    const auto at = values.find(wanted);
    if (at == values.end()) return usage_error(fmt::format("{} of {} is missing", wanted, name), remedy);
    ParameterEstimate parameter;
    parameter.name = wanted;
    parameter.value = at->second;
    set_parameter(c, parameter, rate_hz);
  }
  if (!is_in_range(kind, c.shape) || c.amplitude < 0.0)
    return usage_error(fmt::format("a value of {} is out of its range", name),
                       "rates are positive, variances not negative, theta and phi between -1 and 1");
  return c;
}

int level_of(const json& row) {
  const auto level = row.at("level").get<double>();
  if (level >= 1.0 && level <= kMaxLevel && level == std::trunc(level)) return static_cast<int>(level);
  throw std::invalid_argument(
      fmt::format("a level is {:g} and must be a whole number of 1 to {}", level, kMaxLevel));
}

FitResult read_fit(const json& j) {
  FitResult fit;
  fit.n = j.at("n").get<std::uint64_t>();
  if (const auto at = j.find("fitted_to"); at != j.end() && at->value("stretches", json()).is_number())
    fit.stretches = at->at("stretches").get<std::size_t>();
  fit.rate_hz = j.at("rate_hz").get<double>();
  if (!(fit.rate_hz > 0.0) || !std::isfinite(fit.rate_hz)) throw std::invalid_argument("rate_hz is no rate");
  const auto spec = parse_model(j.at("model").get<std::string>());
  if (!spec) throw std::invalid_argument(spec.error().text());
  fit.spec = *spec;
  fit.weighting = j.at("weights").get<std::string>() == "ci" ? Weighting::kCi : Weighting::kOptimal;
  fit.efficiency = j.value("efficiency", 1.0);
  fit.intervals = j.value("intervals", "quick") == "inverted" ? Intervals::kInverted : Intervals::kQuick;
  fit.confidence = j.value("confidence", fit.confidence);
  if (!(fit.confidence > 0.0 && fit.confidence < 1.0)) throw std::invalid_argument("confidence is no share");
  for (const json& row : j.at("wv")) {
    FittedLevel level;
    level.observed.level = level_of(row);
    level.observed.tau_samples = std::ldexp(1.0, level.observed.level);
    level.observed.value = number_or_nan(row.at("value"));
    level.observed.ci_low = number_or_nan(row.at("ci_low"));
    level.observed.ci_high = number_or_nan(row.at("ci_high"));
    level.observed.n_coefficients = row.at("n_coefficients").get<std::uint64_t>();
    level.observed.inflation = optional_number(row, "inflation").value_or(1.0);
    level.fitted = number_or_nan(row.at("fitted"));
    level.model_ci_low = optional_number(row, "model_ci_low").value_or(0.0);
    level.model_ci_high = optional_number(row, "model_ci_high").value_or(0.0);
    fit.wv.push_back(level);
  }
  for (const json& row : j.at("parameters")) {
    ParameterEstimate p;
    p.process = row.at("process").get<std::string>();
    p.name = row.at("name").get<std::string>();
    p.unit = row.at("unit").get<std::string>();
    p.value = row.at("value").get<double>();
    p.sd = optional_number(row, "sd");
    p.ci_low = optional_number(row, "ci_low");
    p.ci_high = optional_number(row, "ci_high");
    p.spread_sd = optional_number(row, "spread_sd").value_or(0.0);
    fit.parameters.push_back(p);
  }
  fit.model = model_from_parameters(fit.spec, fit.parameters, fit.rate_hz);
  if (j.contains("covariance")) {
    for (const json& v : j.at("covariance")) fit.covariance.push_back(number_or_nan(v));
  }
  fit.objective = number_or_nan(j.at("objective"));
  fit.model_error = j.value("model_error", 0.0);
  const json& test = j.at("j_test");
  if (test.is_object()) {
    fit.j_test = JTest{test.at("statistic").get<double>(), test.at("dof").get<int>(),
                       test.at("p_value").get<double>()};
  }
  fit.criterion = number_or_nan(j.at("criterion"));
  fit.identifiable = j.at("identifiable").get<bool>();
  fit.simpler_model = j.value("simpler_model", std::string());
  fit.warnings = j.at("warnings").get<std::vector<std::string>>();
  return fit;
}

}  // namespace

json wv_to_json(const WaveletVariance& wv, double rate_hz) {
  json out{{"n", wv.n_valid}, {"rate_hz", rate_hz}, {"wv", json::array()}};
  const bool robust = wv.efficiency < 1.0;
  if (robust) out["efficiency"] = wv.efficiency;
  for (const WvLevel& level : wv.levels) {
    json row = level_to_json(level, rate_hz);
    if (robust) row["rejected_share"] = level.rejected_share;
    out["wv"].push_back(std::move(row));
  }
  return out;
}

json fit_to_json(const FitResult& fit) {
  json out{{"n", fit.n},
           {"rate_hz", fit.rate_hz},
           {"fitted_to",
            {{"seconds", number(static_cast<double>(fit.n) / fit.rate_hz)},
             {"stretches", fit.stretches > 0 ? json(fit.stretches) : json(nullptr)}}},
           {"model", fit.spec.name()},
           {"weights", fit.weighting == Weighting::kCi ? "ci" : "optimal"},
           {"intervals", fit.intervals == Intervals::kQuick ? "quick" : "inverted"},
           {"confidence", fit.confidence},
           {"wv", json::array()},
           {"parameters", json::array()},
           {"covariance", json::array()},
           {"objective", number(fit.objective)},
           {"model_error", number(fit.model_error)},
           {"j_test", nullptr},
           {"criterion", number(fit.criterion)},
           {"identifiable", fit.identifiable},
           {"warnings", fit.warnings}};
  if (!fit.simpler_model.empty()) out["simpler_model"] = fit.simpler_model;
  if (fit.efficiency < 1.0) out["efficiency"] = fit.efficiency;
  for (const FittedLevel& level : fit.wv) {
    json row = level_to_json(level.observed, fit.rate_hz);
    row["fitted"] = number(level.fitted);
    const bool known = level.model_ci_high > 0.0;
    row["model_ci_low"] = known ? number(level.model_ci_low) : json(nullptr);
    row["model_ci_high"] = known ? number(level.model_ci_high) : json(nullptr);
    out["wv"].push_back(std::move(row));
  }
  for (const ParameterEstimate& p : fit.parameters) {
    out["parameters"].push_back({{"process", p.process},
                                 {"name", p.name},
                                 {"unit", p.unit},
                                 {"value", number(p.value)},
                                 {"sd", number(p.sd)},
                                 {"ci_low", number(p.ci_low)},
                                 {"ci_high", number(p.ci_high)}});
    if (p.spread_sd > 0.0) out["parameters"].back()["spread_sd"] = number(p.spread_sd);
  }
  for (const double v : fit.covariance) out["covariance"].push_back(number(v));
  if (fit.j_test) {
    out["j_test"] = {{"statistic", number(fit.j_test->statistic)},
                     {"dof", fit.j_test->dof},
                     {"p_value", number(fit.j_test->p_value)}};
  }
  return out;
}

json fit_to_json(const FitResult& fit, SignalUnit unit) {
  json out = fit_to_json(fit);
  out["unit"] = unit_name(unit);
  out["quantities"] = quantities_to_json(filter_quantities(fit, unit));
  return out;
}

json ranking_to_json(const std::vector<RankedModel>& ranked) {
  json out = json::array();
  for (const RankedModel& m : ranked) {
    out.push_back({{"model", m.fit.spec.name()},
                   {"criterion", m.criterion},
                   {"identifiable", m.fit.identifiable},
                   {"p_value", m.fit.j_test ? json(m.fit.j_test->p_value) : json()},
                   {"reason", m.reason}});
  }
  return out;
}

nlohmann::json sinusoids_to_json(const std::vector<Line>& lines, const FitResult& fit,
                                 const std::string& unit) {
  const double z = boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + fit.confidence));
  const auto parameter = [z](const char* name, const std::string& of_unit, double value, double sd) {
    return nlohmann::json{{"name", name},
                          {"unit", of_unit},
                          {"value", value},
                          {"sd", sd},
                          {"ci_low", std::max(0.0, value - z * sd)},
                          {"ci_high", value + z * sd}};
  };
  nlohmann::json out = nlohmann::json::array();
  for (const Line& line : lines) {
    nlohmann::json wv = nlohmann::json::array();
    for (const FittedLevel& level : fit.wv) wv.push_back(line_wv(line, fit.rate_hz, level.observed.level));
    out.push_back({{"process", fmt::format("SIN{}", out.size() + 1)},
                   {"parameters",
                    {parameter("alpha", unit, line.amplitude, line.amplitude_sd),
                     parameter("frequency", "Hz", line.frequency_hz, line.frequency_sd_hz)}},
                   {"wv", std::move(wv)}});
  }
  return out;
}

std::string fitted_to_words(const json& entry) {
  if (!entry.is_object() || !entry.contains("fitted_to") || !entry.at("fitted_to").is_object()) return {};
  const json& from = entry.at("fitted_to");
  const auto seconds = number_if_any(from, "seconds");
  if (!seconds) return {};
  std::string words = fmt::format("{:.6g} s", *seconds);
  const json regime = entry.value("regime", json());
  if (regime.is_string() && regime != "") words += fmt::format(" of regime {}", regime.get<std::string>());
  if (const auto stretches = number_if_any(from, "stretches"))
    words += fmt::format(" in {:.0f} stretch{}", *stretches, *stretches == 1.0 ? "" : "es");
  const auto begin = number_if_any(from, "begin_s");
  const auto end = number_if_any(from, "end_s");
  if (begin && end) words += fmt::format(", between {:.1f} s and {:.1f} s of the run", *begin, *end);
  return words + lines_in_words(entry);
}

json quantities_to_json(const std::vector<Quantity>& quantities) {
  json out = json::array();
  for (const Quantity& q : quantities) {
    out.push_back({{"process", q.process},
                   {"name", q.name},
                   {"unit", q.unit},
                   {"value", number(q.value)},
                   {"ci_low", number(q.ci_low)},
                   {"ci_high", number(q.ci_high)},
                   {"known", knowledge_name(q.knowledge)}});
  }
  return out;
}

Result<Model> model_from_values(const ModelSpec& spec, double rate_hz,
                                const std::map<std::string, ProcessValues>& values) {
  if (!(rate_hz > 0.0) || !std::isfinite(rate_hz))
    return usage_error(fmt::format("a rate of {} is impossible", rate_hz), "give the samples per second");
  Model model;
  for (const ProcessKind kind : spec.processes) model.components.push_back({kind, 0.0, {}});
  const auto names = component_names(model);
  for (const auto& [name, of_process] : values) {
    if (std::find(names.begin(), names.end(), name) == names.end())
      return usage_error(fmt::format("the model has no {}", name),
                         fmt::format("it has {}", fmt::join(names, ", ")));
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto at = values.find(names[i]);
    if (at == values.end()) return usage_error(fmt::format("the values of {} are missing", names[i]), {});
    auto component = component_of(spec.processes[i], names[i], at->second, rate_hz);
    if (!component) return tl::unexpected<Error>(component.error());
    model.components[i] = *component;
  }
  return model;
}

Result<FitResult> fit_from_json(const json& j) {
  try {
    return read_fit(j);
  } catch (const std::exception& error) {
    return work_error(fmt::format("this is not a fit as `imuscope fit --json` writes it: {}", error.what()));
  }
}

}  // namespace imuscope::noise
