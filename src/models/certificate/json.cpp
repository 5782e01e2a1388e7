#include "models/certificate/json.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "models/noise/json.h"

namespace imuscope::certificate {
namespace {

using nlohmann::json;

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }
json number(const std::optional<double>& value) { return value ? number(*value) : json(nullptr); }

json terms_json(const AxisCertificate& axis) {
  json terms = json::array();
  for (const TermValue& t : axis.terms) {
    terms.push_back({{"symbol", symbol_of(t.term)},
                     {"name", name_of(t.term, is_gyro(axis.unit))},
                     {"unit", t.unit},
                     {"value", number(t.value)},
                     {"ci_low", number(t.ci_low)},
                     {"ci_high", number(t.ci_high)},
                     {"known", knowledge_name(t.knowledge)},
                     {"note", t.note}});
  }
  return terms;
}

json lines_json(const AxisCertificate& axis) {
  json lines = json::array();
  for (const noise::Line& line : axis.lines) {
    lines.push_back({{"frequency_hz", line.frequency_hz},
                     {"frequency_sd_hz", number(line.frequency_sd_hz)},
                     {"amplitude", line.amplitude},
                     {"amplitude_sd", number(line.amplitude_sd)},
                     {"share_of_variance", line.share_of_variance},
                     {"p_value", line.p_value},
                     {"words", in_words(line, unit_name(axis.unit))}});
  }
  return lines;
}

json resonances_json(const AxisCertificate& axis) {
  json resonances = json::array();
  for (const noise::Resonance& r : axis.resonances) {
    resonances.push_back({{"frequency_hz", r.frequency_hz},
                          {"width_hz", r.width_hz},
                          {"rms", r.rms},
                          {"height", r.height},
                          {"p_value", r.p_value},
                          {"words", in_words(r, unit_name(axis.unit))}});
  }
  return resonances;
}

json allan_json(const AxisCertificate& axis) {
  json points = json::array();
  for (const noise::AllanPoint& p : axis.allan) {
    points.push_back({{"tau_s", p.tau_s},
                      {"deviation", number(p.deviation)},
                      {"ci_low", number(p.ci_low)},
                      {"ci_high", number(p.ci_high)},
                      {"model", number(model_allan_deviation(axis.fit.model, static_cast<double>(p.n)))}});
  }
  return points;
}

json density_json(const AxisCertificate& axis) {
  json points = json::array();
  for (const noise::DensityPoint& p : axis.density) {
    points.push_back({{"frequency_hz", p.frequency_hz},
                      {"density", number(p.density)},
                      {"ci_low", number(p.ci_low)},
                      {"ci_high", number(p.ci_high)}});
  }
  return points;
}

json temperature_json(const std::optional<Temperature>& t) {
  if (!t) return nullptr;
  return {{"mean_c", t->mean_c},
          {"lowest_c", t->lowest_c},
          {"highest_c", t->highest_c},
          {"bias_per_c", number(t->bias_per_c)},
          {"bias_per_c_sd", number(t->bias_per_c_sd)},
          {"bias_p_value", number(t->bias_p_value)},
          {"noise_variance_per_c", number(t->noise_per_c)},
          {"noise_variance_per_c_sd", t->noise_per_c ? number(t->noise_per_c_sd) : json(nullptr)}};
}

json axis_json(const AxisCertificate& axis) {
  json out{{"name", axis.name},
           {"unit", std::string(unit_name(axis.unit))},
           {"n_samples", axis.n_samples},
           {"n_missing", axis.n_missing},
           {"mean", number(axis.mean)},
           {"sd", number(axis.sd)},
           {"resolution", number(axis.resolution)},
           {"terms", terms_json(axis)},
           {"lines", lines_json(axis)},
           {"resonances", resonances_json(axis)},
           {"low_pass_hz", number(axis.low_pass_hz)},
           {"fit", fit_to_json(axis.fit)},
           {"largest_miss", number(axis.largest_miss)},
           {"models_as_good", axis.rivals},
           {"allan", allan_json(axis)},
           {"density", density_json(axis)},
           {"temperature", temperature_json(axis.temperature)},
           {"warnings", axis.warnings},
           {"limits", axis.limits}};
  out["halves"] = axis.halves ? json{{"p_value", axis.halves->p_value},
                                     {"level", axis.halves->level},
                                     {"ratio", number(axis.halves->ratio)}}
                              : json(nullptr);
  out["spikes"] = axis.tails ? json{{"p_value", axis.tails->p_value}, {"excess", number(axis.tails->excess)}}
                             : json(nullptr);
  return out;
}

}  // namespace

json pairs_json(const JointAxes& joint, const std::vector<std::string>& names) {
  json out = json::array();
  for (const JointPair& pair : joint.pairs) {
    out.push_back({{"signals", {names[pair.first], names[pair.second]}},
                   {"tau_s", pair.tau_s},
                   {"coherence", number(pair.coherence.value)},
                   {"ci_low", number(pair.coherence.ci_low)},
                   {"ci_high", number(pair.coherence.ci_high)},
                   {"p_holm", number(pair.p_holm)},
                   {"shows", pair.shows()}});
  }
  return out;
}

json to_json(const Origin& origin, const std::vector<AxisCertificate>& axes) {
  json out{{"schema", "imuscope.certificate/1"}, {"sensor", origin.sensor},     {"files", origin.files},
           {"selection", origin.selection},      {"made_utc", origin.made_utc}, {"version", origin.version}};
  double rate_hz = 0.0;
  double duration_s = 0.0;
  double confidence = 0.0;
  out["axes"] = json::array();
  for (const AxisCertificate& axis : axes) {
    rate_hz = axis.fit.rate_hz;
    confidence = axis.fit.confidence;
    duration_s = std::max(duration_s, static_cast<double>(axis.n_samples + axis.n_missing) / rate_hz);
    out["axes"].push_back(axis_json(axis));
  }
  out["rate_hz"] = rate_hz;
  out["duration_s"] = duration_s;
  out["confidence"] = confidence;
  return out;
}

}  // namespace imuscope::certificate
