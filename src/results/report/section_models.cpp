#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/grouped.h"
#include "results/report/data_sheet_table.h"
#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/report/verdict.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

const char* signal_unit(std::size_t signal) { return signal < kTriad ? "deg/s" : "m/s²"; }

Html error_panels(const SImuFiles& study, FigureSheet& figures) {
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
  for (const SImuFiles& study : run.studies) {
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

/// The tests of difference of one axis, in comparison.json; null where there are none.
const nlohmann::json& find_comparison(const RunFiles& run, const std::string& imu, const std::string& axis) {
  static const nlohmann::json kNone;
  for (const auto& entry : field(run.comparison, "comparisons")) {
    if (text_at(entry, "name") == imu && text_at(entry, "axis") == axis) return entry;
  }
  return kNone;
}

/// How the second regime's parameter stands to the first's, and what the test says of it.
std::vector<Html> difference_cells(const nlohmann::json& comparison, const FitParameter& parameter) {
  for (const auto& entry : field(comparison, "parameters")) {
    if (text_at(entry, "process") != parameter.process || text_at(entry, "name") != parameter.name) continue;
    const auto ratio = number_at(entry, "ratio");
    const std::string verdict = text_at(entry, "verdict");
    return {
        ratio ? with_interval(*ratio, number_at(entry, "ratio_ci_low"), number_at(entry, "ratio_ci_high"))
              : text(kUnknown),
        p_words(number_at(entry, "p_holm")),
        verdict == "differs" ? element("strong", text(verdict)) : text(verdict.empty() ? kUnknown : verdict)};
  }
  return {text(kUnknown), text(kUnknown), text(kUnknown)};
}

std::string joint_words(const nlohmann::json& comparison) {
  const auto& joint = field(comparison, "joint");
  const auto p = number_at(joint, "p_holm");
  if (!p) return {};
  const std::string words = *p < kSmallestP ? "< 10⁻⁶" : fmt::format("= {:.2g}", *p);
  return fmt::format(" · all parameters together: χ² = {:.4g} with {:.0f} degrees of freedom, p {}",
                     number_at(joint, "statistic").value_or(0.0), number_at(joint, "dof").value_or(0.0),
                     words);
}

std::string test_words(const Fit& fit) {
  std::string words = "not tested";
  if (fit.j_p_value) {
    words =
        *fit.j_p_value < kSmallestP ? "J-test p < 10⁻⁶" : fmt::format("J-test p = {:.2g}", *fit.j_p_value);
  }
  if (fit.n) words += fmt::format(", n = {:.0f}", *fit.n);
  if (!fit.identifiable) words += ", not identifiable";
  return words;
}

Html axis_heading(const std::string& axis, const std::vector<const Fit*>& fits, const std::string& joint) {
  std::string words = axis_words(axis);
  for (const Fit* fit : fits) {
    if (fit == nullptr) continue;
    words +=
        fmt::format(" · {}: {}, {}", fit->regime.empty() ? "all" : fit->regime, fit->model, test_words(*fit));
  }
  return text(words + joint);
}

Html parameter_table(const RunFiles& run, const std::vector<Fit>& fits, const std::string& imu,
                     const std::vector<std::string>& regimes) {
  const bool tested = !field(run.comparison, "comparisons").empty();
  std::vector<Html> headings{text("parameter"), text("unit")};
  for (const std::string& regime : regimes) headings.push_back(text(regime.empty() ? "all" : regime));
  if (tested) {
    for (const char* heading : {"ratio", "p, corrected", "test"}) headings.push_back(text(heading));
  }
  Table table(std::move(headings));
  for (const char* axis : kAxes) {
    std::vector<const Fit*> of_axis;
    for (const std::string& regime : regimes) of_axis.push_back(find_fit(fits, imu, axis, regime));
    const auto parameters = all_parameters(of_axis);
    if (parameters.empty()) continue;
    const auto& comparison = find_comparison(run, imu, axis);
    table.add_group(axis_heading(axis, of_axis, joint_words(comparison)));
    for (const FitParameter& parameter : parameters) {
      std::vector<Html> row{parameter_name(parameter), text(parameter.unit)};
      for (const Fit* fit : of_axis) row.push_back(parameter_cell(fit, find_parameter(fit, parameter)));
      if (tested) {
        for (Html& cell : difference_cells(comparison, parameter)) row.push_back(std::move(cell));
      }
      table.add_row(std::move(row));
    }
  }
  return table.empty() ? paragraph("No model of this sensor.") : table.html();
}

/// Levels that a regime's stretches are too short for.
Html left_out(const RunFiles& run, const std::string& imu) {
  std::vector<std::string> sentences;
  for (const auto& entry : field(run.regimes, "left_out")) {
    if (text_at(entry, "name") == imu) sentences.push_back(text_at(entry, "sentence"));
  }
  return list_of(sentences, "note");
}

/// How the drive was divided, and how much there is of each part.
Html regimes_table(const RunFiles& run) {
  if (run.regimes.is_null()) return {};
  Table table({text("regime"), text("altogether"), text("longest stretch"), text("stretches")});
  for (const auto& regime : field(run.regimes, "regimes")) {
    const auto total_s = number_at(regime, "total_s");
    const auto longest_s = number_at(regime, "longest_s");
    table.add_row({text(text_at(regime, "name")), text(total_s ? duration_words(*total_s) : kUnknown),
                   text(longest_s ? duration_words(*longest_s) : kUnknown),
                   count(static_cast<double>(field(regime, "stretches").size()))});
  }
  Html remarks;
  for (const auto& remark : field(run.regimes, "remarks")) {
    if (remark.is_string()) remarks += element("li", text(remark.get<std::string>()));
  }
  return (table.empty() ? Html{} : table.html()) + (remarks.empty() ? Html{} : element("ul", remarks));
}

/// What the fits remark, each remark once with the axes that it is of.
Html fit_warnings(const std::vector<Fit>& fits, const std::string& imu) {
  std::vector<Named> remarks;
  for (const Fit& fit : fits) {
    if (fit.imu != imu) continue;
    for (const std::string& warning : fit.warnings)
      remarks.push_back({fmt::format("{} ({})", axis_words(fit.axis), fit.regime), warning});
  }
  return list_of(grouped(remarks), "note");
}

/// Whether the tests of all parameters together say that the regimes' models of an axis differ.
bool regimes_differ(const nlohmann::json& comparison) {
  const auto p = number_at(field(comparison, "joint"), "p_holm");
  return p && *p < kTestLevel;
}

/// The fits of an axis whose test rejects them after correction for all tests of the run.
bool is_rejected(const Fit& fit, std::size_t n_tests) {
  return fit.j_p_value && *fit.j_p_value * static_cast<double>(n_tests) < kTestLevel;
}

/// One line for each axis of all S-IMUs: the random walk in each regime, whether they differ, the model,
/// whether it holds.
Html overview_table(const RunFiles& run, const std::vector<Fit>& fits,
                    const std::vector<std::string>& regimes) {
  const bool tested = !field(run.comparison, "comparisons").empty();
  std::vector<Html> headings{text("axis")};
  for (const std::string& regime : regimes)
    headings.push_back(text(fmt::format("random walk, {}", regime.empty() ? "all" : regime)));
  if (tested) headings.push_back(text("rest and motion"));
  headings.push_back(text("model"));
  headings.push_back(text("against the data"));
  Table table(std::move(headings));
  for (const SImuFiles& study : run.studies) {
    table.add_group(text(study.name));
    std::vector<std::vector<noise::AxisFit>> walks;
    for (const std::string& regime : regimes) walks.push_back(axis_fits(run, study.name, regime));
    for (const char* axis : kAxes) {
      std::vector<Html> row{text(axis_words(axis))};
      std::string model;
      bool rejected = false;
      bool any = false;
      for (std::size_t i = 0; i < regimes.size(); ++i) {
        const Fit* fit = find_fit(fits, study.name, axis, regimes[i]);
        row.push_back(random_walk_cell(walks[i], axis));
        if (fit == nullptr) continue;
        any = true;
        if (model.find(fit->model) == std::string::npos) model += (model.empty() ? "" : "; ") + fit->model;
        rejected = rejected || is_rejected(*fit, fits.size());
      }
      if (!any) continue;
      if (tested) {
        row.push_back(regimes_differ(find_comparison(run, study.name, axis))
                          ? element("strong", text("differ"))
                          : text("no difference shown"));
      }
      row.push_back(text(model));
      row.push_back(rejected ? element("strong", text("contradicted"), "no") : text("not contradicted"));
      table.add_row(std::move(row));
    }
  }
  return table.html();
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
  return panels.empty() ? paragraph("No wavelet variance of this sensor.")
                        : element("div", panels, "panels wide");
}

/// Every model that has an entry was fitted by the same rules.
Html interval_words(const RunFiles& run) {
  const bool has_quick = std::any_of(run.models.begin(), run.models.end(), [](const nlohmann::json& entry) {
    return entry.is_object() && entry.value("intervals", nlohmann::json()) == "quick";
  });
  if (!has_quick) return {};
  return paragraph(
      "The intervals are the quick ones of a run: from the estimate's own covariance, without one for a "
      "process that lasts less than 20 correlation times, and with “below” where a fast process may "
      "hold any part of the white noise. “imuscope fit” of an errors file inverts a test instead, which "
      "holds for slow and weak processes.");
}

}  // namespace

Html errors_section(const RunFiles& run, FigureSheet& figures) {
  Html section = heading("errors", "Figure 2: the error signals");
  section += paragraph(
      "Sample of the S-IMU minus the reference at the same instant, turned into the sensor's axes and "
      "moved to its place. The sensor's own bias is part of it. Line: mean over a short stretch of time; "
      "band: smallest to largest sample in it; darker ground: at rest. Where there is a gap in the "
      "record there is a gap in the line.");
  section += rms_table(run);
  for (const SImuFiles& study : run.studies) {
    section +=
        fold(study.name,
             study.errors
                 ? error_panels(study, figures)
                 : paragraph(fmt::format("No errors_{}.csv with samples in this run folder.", study.name)),
             &study == &run.studies.front());
  }
  return section;
}

Html models_section(const RunFiles& run, const std::vector<Fit>& fits, FigureSheet& figures) {
  Html section = heading("noise", "Figure 4: wavelet variance and noise model");
  if (fits.empty()) {
    return section + paragraph("No noise model in this run (models.json is absent or empty).");
  }
  const auto regimes = particular_regimes(regimes_of(fits));
  section += paragraph(
      "Haar wavelet variance of the error signals at the scales τ, in s: points with their 95 % intervals; "
      "line: the variance that the fitted model implies; dashed: its processes one by one. Where the line "
      "leaves the intervals the model does not explain the signal.");
  for (const SImuFiles& study : run.studies) {
    section +=
        fold(study.name, wavelet_panels(fits, study.name, regimes, figures), &study == &run.studies.front());
  }
  section += heading("table-2", "Table II: the noise models");
  section += regimes_table(run) + overview_table(run, fits, regimes);
  section += field(run.comparison, "comparisons").empty()
                 ? paragraph(
                       "No comparison.json with two regimes in this run: the models are shown side by "
                       "side without a test of difference.")
                 : paragraph(
                       "Whether rest and motion differ is tested with all parameters of an axis together, "
                       "corrected for the number of tests (Holm); “no difference shown” is not “equal”.");
  for (const SImuFiles& study : run.studies) {
    section += fold(
        fmt::format("Every parameter of {}, with 95 % intervals", study.name),
        paragraph(
            "WN: white noise; GM: first-order Gauss-Markov process (β its rate, τ = 1/β its correlation "
            "time, σ² its variance); RW: random walk; QN: quantisation noise. Ratio: the second regime's "
            "parameter over the first's.") +
            interval_words(run) + parameter_table(run, fits, study.name, regimes) +
            left_out(run, study.name) + fit_warnings(fits, study.name));
  }
  return section;
}

}  // namespace imuscope::report
