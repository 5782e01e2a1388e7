#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "conversions.h"
#include "models/noise/allan.h"
#include "models/noise/export.h"
#include "models/noise/json.h"
#include "models/noise/select.h"
#include "models/noise/signal.h"
#include "models/noise/simulated_noise.h"

namespace imuscope::python {
namespace {

namespace py = pybind11;
using nlohmann::json;

/// A wavelet variance with what belongs to it, as Python keeps it.
struct Look {
  noise::SignalLook look;
  double rate_hz = 0.0;
  std::string unit;
};

struct SignalChoice {
  Numbers x;
  std::optional<Truths> mask;
  double rate_hz;
  std::string unit;
  int levels;
  std::optional<double> efficiency;  ///< of the robust estimate; absent: the classical one
  bool nan_is_gap;
  double confidence;
};

void check_rate(double rate_hz) {
  if (!(rate_hz > 0.0) || !std::isfinite(rate_hz))
    throw Failure({ErrorKind::kUsage, "rate_hz is impossible", "give the samples per second"});
}

noise::WvOptions options_of(const SignalChoice& choice) {
  check_rate(choice.rate_hz);
  (void)take(noise::parse_unit(choice.unit));
  noise::WvOptions options;
  options.levels = choice.levels;
  options.nan_is_gap = choice.nan_is_gap;
  options.confidence = choice.confidence;
  if (choice.mask) options.mask = span_of(*choice.mask);
  if (choice.efficiency) options.robust = noise::RobustOptions{*choice.efficiency, std::nullopt};
  return options;
}

Look wavelet_variance(const SignalChoice& choice) {
  const auto options = options_of(choice);
  const auto x = span_of(choice.x);
  const py::gil_scoped_release unlocked;
  Look out{{}, choice.rate_hz, choice.unit};
  out.look.wv = take(noise::haar_wavelet_variance(x, options));
  return out;
}

Look look_at(const SignalChoice& choice, bool takes_lines_out) {
  const auto options = options_of(choice);
  const auto x = span_of(choice.x);
  const py::gil_scoped_release unlocked;
  return {take(noise::look_at_signal(x, options, choice.rate_hz,
                                     takes_lines_out ? noise::Lines::kTakenOut : noise::Lines::kStay)),
          choice.rate_hz, choice.unit};
}

noise::FitOptions fit_options(const Look& look, const std::string& weights, double confidence, bool quick) {
  noise::FitOptions options;
  if (weights != "optimal" && weights != "ci")
    throw Failure({ErrorKind::kUsage, "there are no weights '" + weights + "'", "they are optimal or ci"});
  options.weighting = weights == "ci" ? noise::Weighting::kCi : noise::Weighting::kOptimal;
  options.intervals = quick ? noise::Intervals::kQuick : noise::Intervals::kInverted;
  options.confidence = confidence;
  options.signal_unit = look.unit;
  return options;
}

/// A fit with what the signal's look adds to it, as `imuscope fit --json` has it.
json document_of(noise::FitResult fit, const Look& look, bool lines_were_taken_out) {
  std::vector<std::string> warnings;
  for (const auto& line : look.look.lines)
    warnings.push_back(noise::in_words(line, look.unit) +
                       (lines_were_taken_out ? ": taken out before the fit (keep_lines=True leaves it in)"
                                             : ": it raises the levels around half its period"));
  if (look.look.spikes) warnings.push_back(*look.look.spikes);
  fit.warnings.insert(fit.warnings.begin(), warnings.begin(), warnings.end());
  json document = noise::fit_to_json(fit, noise::parse_unit(look.unit).value());
  if (lines_were_taken_out && !look.look.lines.empty())
    document["sinusoids"] = noise::sinusoids_to_json(look.look.lines, fit, look.unit);
  return document;
}

std::string fit(const Look& look, const std::string& model, const std::string& weights, double confidence,
                bool quick, bool lines_were_taken_out) {
  const py::gil_scoped_release unlocked;
  const auto spec = take(noise::parse_model(model));
  auto fitted =
      take(noise::fit(look.look.wv, spec, look.rate_hz, fit_options(look, weights, confidence, quick)));
  return json_text(document_of(std::move(fitted), look, lines_were_taken_out), kJsonOneLine);
}

std::string select(const Look& look, const std::string& model, const std::string& weights, double confidence,
                   bool quick, bool lines_were_taken_out) {
  const py::gil_scoped_release unlocked;
  const auto spec = take(noise::parse_model(model));
  const auto ranked = take(
      noise::rank_models(look.look.wv, spec, look.rate_hz, fit_options(look, weights, confidence, true)));
  auto options = fit_options(look, weights, confidence, quick);
  options.warm_start = &ranked.front().fit;
  auto best = take(noise::fit(look.look.wv, ranked.front().fit.spec, look.rate_hz, options));
  json document = document_of(std::move(best), look, lines_were_taken_out);
  document["ranking"] = noise::ranking_to_json(ranked);
  return json_text(document, kJsonOneLine);
}

json parsed(const std::string& text) {
  json document = json::parse(text, nullptr, false);
  if (document.is_discarded()) throw Failure({ErrorKind::kUsage, "this is no JSON document", {}});
  return document;
}

py::dict allan_deviation(const SignalChoice& choice, int points_per_octave, const std::string& fit_document) {
  const auto options = options_of(choice);
  if (points_per_octave < 1)
    throw Failure({ErrorKind::kUsage, "points_per_octave is below 1", "give 1 or more"});
  const auto x = span_of(choice.x);
  std::vector<noise::AllanPoint> points;
  {
    const py::gil_scoped_release unlocked;
    const auto wv = take(noise::haar_wavelet_variance(x, options));
    points = noise::allan_deviation({x.begin(), x.end()}, wv, choice.rate_hz, points_per_octave);
    std::optional<noise::FitResult> fitted;
    if (!fit_document.empty()) fitted = take(noise::fit_from_json(parsed(fit_document)));
    noise::set_allan_intervals(points, fitted ? &*fitted : nullptr, choice.confidence);
  }
  py::dict out;
  const auto column = [&](const char* name, auto value) {
    std::vector<double> values;
    for (const auto& point : points) values.push_back(static_cast<double>(value(point)));
    out[name] = array_of(std::move(values));
  };
  column("tau_s", [](const noise::AllanPoint& p) { return p.tau_s; });
  column("deviation", [](const noise::AllanPoint& p) { return p.deviation; });
  column("ci_low", [](const noise::AllanPoint& p) { return p.ci_low; });
  column("ci_high", [](const noise::AllanPoint& p) { return p.ci_high; });
  column("degrees_of_freedom", [](const noise::AllanPoint& p) { return p.degrees_of_freedom; });
  column("n_differences", [](const noise::AllanPoint& p) { return p.n_differences; });
  return out;
}

std::string export_models(const std::vector<std::tuple<std::string, std::string>>& axes,
                          const std::string& to, bool conservative, bool force) {
  const py::gil_scoped_release unlocked;
  const auto format = take(noise::parse_export_format(to));
  std::vector<noise::AxisFit> fits;
  for (const auto& [axis, document] : axes) {
    const json entry = parsed(document);
    noise::AxisFit fit{axis, noise::SignalUnit::kNone, take(noise::fit_from_json(entry)),
                       noise::fitted_to_words(entry)};
    if (const auto unit = entry.find("unit"); unit != entry.end() && unit->is_string())
      fit.unit = take(noise::parse_unit(unit->get<std::string>()));
    fits.push_back(std::move(fit));
  }
  return take(noise::export_models(fits, format, {conservative, force}));
}

py::array_t<double> simulate(const std::string& model,
                             const std::map<std::string, noise::ProcessValues>& values, std::int64_t n,
                             double rate_hz, std::uint64_t seed) {
  if (n < 0) throw Failure({ErrorKind::kUsage, "n is below zero", "give the number of samples"});
  const auto truth = take(noise::model_from_values(take(noise::parse_model(model)), rate_hz, values));
  py::array_t<double> x(n);
  const std::span<double> span{x.mutable_data(), static_cast<std::size_t>(n)};
  const py::gil_scoped_release unlocked;
  std::mt19937_64 random(seed);
  noise::simulate_noise(truth, random, span);
  return x;
}

SignalChoice choice_of(Numbers x, std::optional<Truths> mask, double rate_hz, std::string unit, int levels,
                       std::optional<double> efficiency, bool nan_is_gap, double confidence) {
  return {std::move(x), std::move(mask), rate_hz,    std::move(unit),
          levels,       efficiency,      nan_is_gap, confidence};
}

/// A column of the levels as an array.
template <typename T, typename Value>
auto level_column(Value value) {
  return [value](const Look& look) {
    std::vector<T> values;
    for (const auto& level : look.look.wv.levels) values.push_back(static_cast<T>(value(level, look)));
    return array_of(std::move(values));
  };
}

void bind_wavelet_variance(py::module_& module) {
  using noise::WvLevel;
  py::class_<Look>(module, "WaveletVariance")
      .def_property_readonly("n", [](const Look& look) { return look.look.wv.n_valid; })
      .def_readonly("rate_hz", &Look::rate_hz)
      .def_readonly("unit", &Look::unit)
      .def_property_readonly("efficiency", [](const Look& look) { return look.look.wv.efficiency; })
      .def_property_readonly(
          "level", level_column<std::int64_t>([](const WvLevel& l, const Look&) { return l.level; }))
      .def_property_readonly("tau_s", level_column<double>([](const WvLevel& l, const Look& look) {
                               return l.tau_samples / look.rate_hz;
                             }))
      .def_property_readonly("value",
                             level_column<double>([](const WvLevel& l, const Look&) { return l.value; }))
      .def_property_readonly("ci_low",
                             level_column<double>([](const WvLevel& l, const Look&) { return l.ci_low; }))
      .def_property_readonly("ci_high",
                             level_column<double>([](const WvLevel& l, const Look&) { return l.ci_high; }))
      .def_property_readonly("n_coefficients", level_column<std::int64_t>([](const WvLevel& l, const Look&) {
                               return l.n_coefficients;
                             }));
}

}  // namespace

void bind_noise(py::module_& module) {
  bind_wavelet_variance(module);
  py::class_<SignalChoice>(module, "Signal")
      .def(py::init(&choice_of), py::arg("x"), py::arg("mask"), py::arg("rate_hz"), py::arg("unit"),
           py::arg("levels"), py::arg("efficiency"), py::arg("nan_is_gap"), py::arg("confidence"));
  module.def("wavelet_variance", &wavelet_variance);
  module.def("look_at", &look_at);
  module.def("fit", &fit);
  module.def("select", &select);
  module.def("allan_deviation", &allan_deviation);
  module.def("export_models", &export_models);
  module.def("simulate", &simulate);
}

}  // namespace imuscope::python
