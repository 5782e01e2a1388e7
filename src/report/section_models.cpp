#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "report/json_fields.h"
#include "report/people.h"
#include "report/sections.h"

namespace imuscope::report {
namespace {

constexpr std::size_t kTriad = 3;

const char* signal_unit(std::size_t signal) { return signal < kTriad ? "deg/s" : "m/s²"; }

Html error_panels(const StudyFiles& study, FigureSheet& figures) {
  Html panels;
  for (std::size_t signal = 0; signal < kErrorSignals; ++signal) {
    Figure figure;
    figure.id = fmt::format("error-{}-{}", kAxes[signal], study.name);
    figure.group = "errors of " + study.name;
    figure.y_label = signal_unit(signal);
    figure.shaded = study.static_stretches;
    panels += figures.range_figure(figure, *study.errors, signal, static_cast<int>(signal % kTriad),
                                   text(axis_words(kAxes[signal]) + ", " + signal_unit(signal)));
  }
  return element("div", panels, "panels");
}

Html rms_table(const RunFiles& run) {
  Table table({text("root mean square"), text("gyro x, deg/s"), text("y"), text("z"), text("accel x, m/s²"),
               text("y"), text("z"), text("samples")});
  for (const StudyFiles& study : run.studies) {
    if (!study.errors) continue;
    std::vector<Html> row{text(study.name)};
    for (const double rms : study.rms) row.push_back(number(rms, 3));
    row.push_back(count(static_cast<double>(study.n_errors)));
    table.add_row(std::move(row));
  }
  return table.empty() ? Html{} : table.html();
}

/// "GM1 β" for people.
Html parameter_name(const FitParameter& parameter) {
  constexpr std::pair<std::string_view, const char*> kSymbols[] = {
      {"sigma2", "σ²"}, {"gamma2", "γ²"}, {"q2", "Q²"}, {"beta", "β"}, {"omega", "ω"}};
  const auto* known = std::find_if(std::begin(kSymbols), std::end(kSymbols),
                                   [&](const auto& symbol) { return symbol.first == parameter.name; });
  return text(parameter.process + " ") + text(known == std::end(kSymbols) ? parameter.name : known->second);
}

const FitParameter* find_parameter(const Fit* fit, const FitParameter& like) {
  if (fit == nullptr) return nullptr;
  const auto found =
      std::find_if(fit->parameters.begin(), fit->parameters.end(), [&](const FitParameter& parameter) {
        return parameter.process == like.process && parameter.name == like.name;
      });
  return found == fit->parameters.end() ? nullptr : &*found;
}

/// Whether the fit gave the process of `parameter` no amplitude: its rate then means nothing.
bool is_unsupported(const Fit& fit, const FitParameter& parameter) {
  return std::any_of(fit.parameters.begin(), fit.parameters.end(), [&](const FitParameter& other) {
    return other.process == parameter.process && other.name != "beta" && other.value == 0.0;
  });
}

Html parameter_cell(const Fit* fit, const FitParameter* parameter) {
  if (parameter == nullptr || !parameter->value) return text(kUnknown);
  const bool rate = parameter->name == "beta";
  if (rate && is_unsupported(*fit, *parameter)) return text(kUnknown);
  Html cell = with_interval(*parameter->value, parameter->ci_low, parameter->ci_high);
  if (rate && *parameter->value > 0.0) {
    cell += element("span", text(" τ ") + number(1.0 / *parameter->value, 2) + text(" s"), "interval");
  }
  return cell;
}

/// Every parameter that one of the fits has, in their order.
std::vector<FitParameter> all_parameters(const std::vector<const Fit*>& fits) {
  std::vector<FitParameter> parameters;
  for (const Fit* fit : fits) {
    if (fit == nullptr) continue;
    for (const FitParameter& parameter : fit->parameters) {
      const bool known = std::any_of(parameters.begin(), parameters.end(), [&](const FitParameter& other) {
        return other.process == parameter.process && other.name == parameter.name;
      });
      if (!known) parameters.push_back(parameter);
    }
  }
  return parameters;
}

/// Whether the intervals of the same parameter in two regimes lie apart.
std::string difference_words(const FitParameter* one, const FitParameter* other) {
  if (one == nullptr || other == nullptr || !one->ci_low || !one->ci_high || !other->ci_low ||
      !other->ci_high) {
    return kUnknown;
  }
  return *one->ci_high < *other->ci_low || *other->ci_high < *one->ci_low ? "differ" : "overlap";
}

std::string test_words(const Fit& fit) {
  // Below this the p value says no more than that it is small.
  constexpr double kSmallest = 1e-6;
  std::string words = "not tested";
  if (fit.j_p_value) {
    words = *fit.j_p_value < kSmallest ? "J-test p < 10⁻⁶" : fmt::format("J-test p = {:.2g}", *fit.j_p_value);
  }
  if (fit.n) words += fmt::format(", n = {:.0f}", *fit.n);
  if (!fit.identifiable) words += ", not identifiable";
  return words;
}

Html axis_heading(const std::string& axis, const std::vector<const Fit*>& fits) {
  std::string words = axis_words(axis);
  for (const Fit* fit : fits) {
    if (fit == nullptr) continue;
    words +=
        fmt::format(" · {}: {}, {}", fit->regime.empty() ? "all" : fit->regime, fit->model, test_words(*fit));
  }
  return text(words);
}

Html parameter_table(const std::vector<Fit>& fits, const std::string& imu,
                     const std::vector<std::string>& regimes) {
  const bool comparable = regimes.size() >= 2 && regimes[0] == "static" && regimes[1] == "dynamic";
  std::vector<Html> headings{text("parameter"), text("unit")};
  for (const std::string& regime : regimes) headings.push_back(text(regime.empty() ? "all" : regime));
  if (comparable) headings.push_back(text("intervals"));
  Table table(std::move(headings));
  for (const char* axis : kAxes) {
    std::vector<const Fit*> of_axis;
    for (const std::string& regime : regimes) of_axis.push_back(find_fit(fits, imu, axis, regime));
    const auto parameters = all_parameters(of_axis);
    if (parameters.empty()) continue;
    table.add_group(axis_heading(axis, of_axis));
    for (const FitParameter& parameter : parameters) {
      std::vector<Html> row{parameter_name(parameter), text(parameter.unit)};
      for (const Fit* fit : of_axis) row.push_back(parameter_cell(fit, find_parameter(fit, parameter)));
      if (comparable) {
        row.push_back(text(
            difference_words(find_parameter(of_axis[0], parameter), find_parameter(of_axis[1], parameter))));
      }
      table.add_row(std::move(row));
    }
  }
  return table.empty() ? paragraph("No model of this sensor.") : table.html();
}

Html fit_warnings(const std::vector<Fit>& fits, const std::string& imu) {
  Html items;
  for (const Fit& fit : fits) {
    if (fit.imu != imu) continue;
    for (const std::string& warning : fit.warnings) {
      items += element("li", text(axis_words(fit.axis) + " (" + fit.regime + "): " + warning));
    }
  }
  return items.empty() ? Html{} : element("ul", items, "note");
}

Html wavelet_panels(const std::vector<Fit>& fits, const std::string& imu,
                    const std::vector<std::string>& regimes, FigureSheet& figures) {
  Html panels;
  for (const char* axis : kAxes) {
    std::vector<const Fit*> of_axis;
    for (const std::string& regime : regimes) {
      const Fit* fit = find_fit(fits, imu, axis, regime);
      if (fit != nullptr && !fit->levels.empty()) of_axis.push_back(fit);
    }
    if (of_axis.empty()) continue;
    panels += figures.wavelet_figure(fmt::format("wavelet-{}-{}", axis, imu), of_axis,
                                     text(fmt::format("{}, ({})²", axis_words(axis), of_axis.front()->unit)));
  }
  return panels.empty() ? paragraph("No wavelet variance of this sensor.") : element("div", panels, "panels");
}

}  // namespace

Html errors_section(const RunFiles& run, FigureSheet& figures) {
  Html section = element("h2", text("Figure 2: the error signals"));
  section += paragraph(
      "Sample of the S-IMU minus the reference at the same instant, turned into the sensor's axes and moved "
      "to its "
      "place. The sensor's own bias is part of it. Line: mean over a short stretch of time; band: smallest "
      "to largest "
      "sample in it; darker ground: at rest. Where there is a gap in the record there is a gap in the line.");
  section += rms_table(run);
  for (const StudyFiles& study : run.studies) {
    section += element("h3", text(study.name));
    section += study.errors
                   ? error_panels(study, figures)
                   : paragraph(fmt::format("No errors_{}.csv with samples in this run folder.", study.name));
  }
  return section;
}

Html models_section(const RunFiles& run, const std::vector<Fit>& fits, FigureSheet& figures) {
  Html section = element("h2", text("Figure 4: wavelet variance and noise model"));
  if (fits.empty()) {
    return section + paragraph("No noise model in this run (models.json is absent or empty).");
  }
  const auto regimes = regimes_of(fits);
  section += paragraph(
      "Haar wavelet variance of the error signals at the scales τ, in s: points with their 95 % intervals; "
      "line: the "
      "variance that the fitted model implies. Where the line leaves the intervals the model does not "
      "explain the signal.");
  for (const StudyFiles& study : run.studies) {
    section += element("h3", text(study.name)) + wavelet_panels(fits, study.name, regimes, figures);
  }
  section += element("h2", text("Table II: parameters of the noise models"));
  section += paragraph(
      "With 95 % intervals. WN: white noise; GM: first-order Gauss-Markov process (β its rate, τ = 1/β its "
      "correlation "
      "time, σ² its variance); RW: random walk; QN: quantisation noise. “Differ” means that the intervals of "
      "the static and "
      "the dynamic model do not overlap.");
  for (const StudyFiles& study : run.studies) {
    section += element("h3", text(study.name)) + parameter_table(fits, study.name, regimes) +
               fit_warnings(fits, study.name);
  }
  return section;
}

}  // namespace imuscope::report
