#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/grouped.h"
#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

using nlohmann::json;

/// More figures of one sensor than this are not looked at.
constexpr std::size_t kFiguresMax = 6;
constexpr double kLevel = 0.05;

Html list_of_remarks(const RunFiles& run, const json& document) {
  std::vector<std::string> remarks;
  for (const json& remark : field(document, "remarks")) {
    if (remark.is_string()) remarks.push_back(remark.get<std::string>());
  }
  return list_of(grouped_by_name(remarks, names_of(run)), "note");
}

/// "+12 % a unit" from a slope of the logarithm.
double percent_of(double slope) { return 100.0 * std::expm1(slope); }

/// A slope with its interval.
Html change_words(const json& entry, const std::string& driver_unit) {
  const auto slope = number_at(entry, "slope");
  if (!slope) return text(kUnknown);
  const auto low = number_at(entry, "ci_low");
  const auto high = number_at(entry, "ci_high");
  return with_interval(percent_of(*slope), low ? std::optional(percent_of(*low)) : low,
                       high ? std::optional(percent_of(*high)) : high) +
         text(" % per " + driver_unit);
}

bool is_clear(const json& entry) {
  const auto p = number_at(entry, "p_holm");
  return p && *p < kLevel;
}

/// @param clear_only  those that are clear of chance after correction
Html dependence_table(const RunFiles& run, const std::string& imu, bool clear_only) {
  Table table({text("parameter"), text("driver"), text("at its mean"), text("change a unit of the driver"),
               text("p, corrected"), text("beside the other drivers"), text("p, corrected")});
  std::string axis;
  for (const json& entry : field(run.dependence, "dependences")) {
    if (text_at(entry, "name") != imu || (clear_only && !is_clear(entry))) continue;
    if (text_at(entry, "axis") != axis) {
      axis = text_at(entry, "axis");
      table.add_group(text(axis_words(axis)));
    }
    std::string unit = text_at(entry, "unit");
    const double factor = shown_unit(unit);
    const auto at_mean = number_at(entry, "at_mean_driver");
    const json& beside = field(entry, "beside_others");
    table.add_row(
        {text(text_at(entry, "process") + " " + text_at(entry, "parameter")), text(text_at(entry, "driver")),
         at_mean ? number(factor * *at_mean, 3) + text(" " + unit) : text(kUnknown),
         change_words(entry, text_at(entry, "driver_unit")), p_words(number_at(entry, "p_holm")),
         change_words(beside, text_at(entry, "driver_unit")), p_words(number_at(beside, "p_holm"))});
  }
  return table.empty() ? Html{} : table.html();
}

/// The variance of the white noise, window by window, against a driver that it follows.
Html dependence_figure(const RunFiles& run, const json& entry, FigureSheet& figures) {
  const std::string imu = text_at(entry, "name");
  const std::string axis = text_at(entry, "axis");
  const std::string driver = text_at(entry, "driver");
  std::string unit = text_at(entry, "unit");
  const double factor = shown_unit(unit);
  std::vector<double> x;
  std::vector<double> y;
  for (const json& point : field(run.dependence, "points")) {
    if (text_at(point, "name") != imu || text_at(point, "axis") != axis) continue;
    const auto at = number_at(field(point, "driver"), driver.c_str());
    const auto value = number_at(point, "value");
    if (!at || !value) continue;
    x.push_back(*at);
    y.push_back(factor * *value);
  }
  if (x.empty()) return {};
  const std::string driver_words = driver + ", " + text_at(entry, "driver_unit");
  return figures.scatter_figure(
      fmt::format("dependence-{}-{}-{}", axis, driver, imu), driver_words, unit, figures.add_column(x),
      figures.add_column(y), 2,
      text(fmt::format("{}: variance of the white noise, {}, against {}", axis_words(axis), unit, driver)));
}

Html dependence_panels(const RunFiles& run, const std::string& imu, FigureSheet& figures) {
  std::vector<const json*> clear;
  for (const json& entry : field(run.dependence, "dependences")) {
    if (text_at(entry, "name") == imu && text_at(entry, "process") == "WN" && is_clear(entry))
      clear.push_back(&entry);
  }
  std::stable_sort(clear.begin(), clear.end(), [](const json* a, const json* b) {
    return number_at(*a, "p_holm").value_or(1.0) < number_at(*b, "p_holm").value_or(1.0);
  });
  if (clear.size() > kFiguresMax) clear.resize(kFiguresMax);
  Html panels;
  for (const json* entry : clear) panels += dependence_figure(run, *entry, figures);
  return panels.empty() ? Html{} : element("div", panels, "panels");
}

/// What could not be told, each reason once with what it is of.
Html not_determined(const RunFiles& run, const std::string& imu) {
  std::vector<Named> reasons;
  for (const json& entry : field(run.dependence, "not_determined")) {
    if (text_at(entry, "name") != imu) continue;
    reasons.push_back({fmt::format("{} {} against {}", axis_words(text_at(entry, "axis")),
                                   text_at(entry, "process"), text_at(entry, "driver")),
                       text_at(entry, "why")});
  }
  return fold("Not determined", list_of(grouped(reasons), "note"));
}

std::optional<double> scaled_sd(const json& line, double factor) {
  const auto sd = number_at(line, "amplitude_sd");
  return sd ? std::optional(factor * *sd) : sd;
}

Html vibration_lines(const RunFiles& run) {
  if (run.vibration.is_null()) return {};
  Table table({text("sensor"), text("regime"), text("frequency, Hz"), text("amplitude"), text("unit"),
               text("share of the variance"), text("p")});
  for (const json& line : field(run.vibration, "lines")) {
    std::string unit = text_at(line, "amplitude_unit");
    const double factor = shown_unit(unit);
    const auto frequency = number_at(line, "frequency_hz");
    const auto amplitude = number_at(line, "amplitude");
    const auto share = number_at(line, "share_of_variance");
    table.add_row({text(text_at(line, "name") + " " + axis_words(text_at(line, "axis"))),
                   text(text_at(line, "regime")),
                   frequency ? with_sd(*frequency, number_at(line, "frequency_sd_hz")) : text(kUnknown),
                   amplitude ? with_sd(factor * *amplitude, scaled_sd(line, factor)) : text(kUnknown),
                   text(unit), text(share ? fmt::format("{:.1f} %", 100.0 * *share) : kUnknown),
                   p_words(number_at(line, "p_value"))});
  }
  return element("h3", text("Vibration lines")) +
         (table.empty() ? paragraph("No line stands out of the noise.") : table.html()) +
         list_of_remarks(run, run.vibration);
}

}  // namespace

Html dependence_section(const RunFiles& run, FigureSheet& figures) {
  Html section = heading("dependence", "How the noise depends on the motion");
  if (run.dependence.is_null()) {
    return section +
           paragraph("No dependence.json in this run: parameters were not studied against the motion.") +
           vibration_lines(run);
  }
  const auto window_s = number_at(run.dependence, "window_s");
  section += paragraph(fmt::format(
      "Parameters fitted to windows{} of the drive, the logarithm of each against the mean of a driver "
      "over its window, with 95 % intervals. p: chance of such a slope without a dependence, corrected "
      "for the number of tests (Holm).",
      window_s ? fmt::format(" of {:g} s", *window_s) : ""));
  section += list_of_remarks(run, run.dependence);
  for (const SImuFiles& study : run.studies) {
    const Html clear = dependence_table(run, study.name, true);
    section += element("h3", text(study.name));
    section += clear.empty() ? paragraph("No parameter follows the motion clear of chance.") : clear;
    section += dependence_panels(run, study.name, figures) +
               fold("All that was tried", dependence_table(run, study.name, false)) +
               not_determined(run, study.name);
  }
  return section + vibration_lines(run);
}

}  // namespace imuscope::report
