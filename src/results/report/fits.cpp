#include "results/report/fits.h"

#include <algorithm>
#include <iterator>

#include "base/units.h"
#include "models/noise/json.h"
#include "models/noise/process.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

using nlohmann::json;

/// Replaces "rad/s" in `unit` by "deg/s" and returns the factor that goes with it.
double shown_in_degrees(std::string& unit) {
  constexpr std::string_view kRadps = "rad/s";
  const std::size_t place = unit.find(kRadps);
  if (place == std::string::npos) return 1.0;
  unit.replace(place, kRadps.size(), "deg/s");
  const bool squared =
      unit.compare(place + kRadps.size(), 3, ")^2") == 0 || unit.compare(place + kRadps.size(), 3, ")²") == 0;
  return squared ? kDegPerRad * kDegPerRad : kDegPerRad;
}

/// "(m/s²)²" for "(m/s^2)^2".
std::string with_raised_twos(std::string unit) {
  constexpr std::string_view kSquare = "^2";
  for (std::size_t place = 0; (place = unit.find(kSquare)) != std::string::npos;) {
    unit.replace(place, kSquare.size(), "²");
  }
  return unit;
}

}  // namespace

double shown_unit(std::string& unit) {
  const double factor = shown_in_degrees(unit);
  unit = with_raised_twos(unit);
  return factor;
}

namespace {

std::optional<double> scaled(std::optional<double> value, double factor) {
  return value ? std::optional(*value * factor) : value;
}

/// @param factor  of the signal's unit
std::vector<FitComponent> components_of(const noise::FitResult& result, double factor) {
  std::vector<FitComponent> components;
  const std::vector<std::string> names = noise::component_names(result.model);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const noise::Component& component = result.model.components[i];
    FitComponent out;
    out.name = names[i];
    if (!(component.amplitude > 0.0)) continue;
    for (const noise::FittedLevel& level : result.wv) {
      out.values.push_back(factor * factor * component.amplitude *
                           noise::unit_wv(component.kind, component.shape, level.observed.level).value);
    }
    components.push_back(std::move(out));
  }
  return components;
}

FitParameter read_parameter(const json& entry) {
  FitParameter parameter;
  parameter.process = text_at(entry, "process");
  parameter.name = text_at(entry, "name");
  parameter.unit = text_at(entry, "unit");
  const double factor = shown_unit(parameter.unit);
  parameter.value = scaled(number_at(entry, "value"), factor);
  parameter.ci_low = scaled(number_at(entry, "ci_low"), factor);
  parameter.ci_high = scaled(number_at(entry, "ci_high"), factor);
  return parameter;
}

/// A vibration line: parameters and a component like any other process of the model.
void read_sinusoid(const json& entry, double factor, Fit& fit) {
  const std::string process = text_at(entry, "process");
  for (const json& parameter : field(entry, "parameters")) {
    fit.parameters.push_back(read_parameter(parameter));
    fit.parameters.back().process = process;
  }
  FitComponent component;
  component.name = process;
  for (const json& value : field(entry, "wv")) {
    if (value.is_number()) component.values.push_back(factor * factor * value.get<double>());
  }
  if (component.values.size() == fit.levels.size()) fit.components.push_back(std::move(component));
}

Fit read_fit(const json& entry) {
  Fit fit;
  fit.imu = text_at(entry, "name");
  fit.axis = text_at(entry, "axis");
  fit.regime = text_at(entry, "regime");
  fit.unit = text_at(entry, "unit");
  fit.model = text_at(entry, "model");
  fit.n = number_at(entry, "n");
  const double factor = shown_unit(fit.unit);
  if (const auto result = noise::fit_from_json(entry)) fit.components = components_of(*result, factor);
  for (const json& level : field(entry, "wv")) {
    const auto tau_s = number_at(level, "tau_s");
    if (!tau_s) continue;
    const double square = factor * factor;
    fit.levels.push_back(
        {*tau_s, scaled(number_at(level, "value"), square), scaled(number_at(level, "ci_low"), square),
         scaled(number_at(level, "ci_high"), square), scaled(number_at(level, "fitted"), square)});
  }
  for (const json& parameter : field(entry, "parameters"))
    fit.parameters.push_back(read_parameter(parameter));
  for (const json& sinusoid : field(entry, "sinusoids")) read_sinusoid(sinusoid, factor, fit);
  fit.j_p_value = number_at(field(entry, "j_test"), "p_value");
  fit.identifiable = field(entry, "identifiable") != json(false);
  for (const json& warning : field(entry, "warnings")) {
    if (warning.is_string()) fit.warnings.push_back(warning.get<std::string>());
  }
  return fit;
}

}  // namespace

std::vector<Fit> read_fits(const json& models) {
  std::vector<Fit> fits;
  for (const json& entry : models) fits.push_back(read_fit(entry));
  return fits;
}

std::vector<std::string> regimes_of(const std::vector<Fit>& fits) {
  std::vector<std::string> regimes;
  const auto take = [&](const std::string& regime) {
    if (std::find(regimes.begin(), regimes.end(), regime) == regimes.end()) regimes.push_back(regime);
  };
  for (const char* first : {"static", "dynamic"}) {
    if (std::any_of(fits.begin(), fits.end(), [&](const Fit& fit) { return fit.regime == first; }))
      take(first);
  }
  for (const Fit& fit : fits) take(fit.regime);
  return regimes;
}

std::vector<std::string> particular_regimes(std::vector<std::string> regimes) {
  const auto is_whole = [](const std::string& regime) { return regime == "all" || regime.empty(); };
  const auto n_whole = std::count_if(regimes.begin(), regimes.end(), is_whole);
  if (std::ssize(regimes) - n_whole >= 2) std::erase_if(regimes, is_whole);
  return regimes;
}

const Fit* find_fit(const std::vector<Fit>& fits, const std::string& imu, const std::string& axis,
                    const std::string& regime) {
  const auto found = std::find_if(fits.begin(), fits.end(), [&](const Fit& fit) {
    return fit.imu == imu && fit.axis == axis && fit.regime == regime;
  });
  return found == fits.end() ? nullptr : &*found;
}

std::string axis_words(const std::string& axis) {
  constexpr const char* kWords[] = {"gyroscope x",     "gyroscope y",     "gyroscope z",
                                    "accelerometer x", "accelerometer y", "accelerometer z"};
  static_assert(std::size(kWords) == std::size(kAxes));
  for (std::size_t i = 0; i < std::size(kAxes); ++i) {
    if (axis == kAxes[i]) return kWords[i];
  }
  return axis;
}

}  // namespace imuscope::report
