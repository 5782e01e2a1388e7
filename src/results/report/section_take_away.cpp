#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <string_view>

#include "models/noise/export.h"
#include "models/noise/json.h"
#include "models/noise/quantities.h"
#include "results/report/data_sheet_table.h"
#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using nlohmann::json;

constexpr std::pair<noise::ExportFormat, const char*> kFormats[] = {
    {noise::ExportFormat::kKalibr, "kalibr"},
    {noise::ExportFormat::kRos, "ros"},
    {noise::ExportFormat::kPx4, "px4"},
    {noise::ExportFormat::kKfGins, "kf-gins"}};

/// "deg/√h" for "deg/sqrt(h)".
std::string with_roots(const std::string& unit) {
  constexpr std::string_view kRoot = "sqrt(";
  const std::size_t at = unit.find(kRoot);
  if (at == std::string::npos || unit.back() != ')') return unit;
  return unit.substr(0, at) + "√" + unit.substr(at + kRoot.size(), unit.size() - at - kRoot.size() - 1);
}

/// What data sheets name, axis by axis.
Html quantity_table(const std::vector<noise::AxisFit>& fits) {
  constexpr const char* kNotKnown = "not known from this record";
  const auto shown = [&](const noise::Quantity& quantity, double factor, int digits) {
    if (quantity.knowledge == noise::Knowledge::kUnknown) return text(kNotKnown);
    const Html value = number(factor * quantity.value, digits);
    return quantity.knowledge == noise::Knowledge::kBound ? text("at most ") + value : value;
  };
  constexpr const char* kWanted[] = {"angle random walk", "velocity random walk", "bias instability"};
  Table table({text("axis"), text("random walk"), text("unit"), text("bias instability"), text("unit"),
               text("slowest process: sd"), text("its correlation time, s")});
  for (const noise::AxisFit& axis : fits) {
    const auto quantities = noise::filter_quantities(axis.fit, axis.unit);
    std::array<Html, 3> value{text(kUnknown), text(kUnknown), text(kUnknown)};
    std::array<std::string, 3> unit;
    Html slow_sd = text(kUnknown);
    Html slow_time = text(kUnknown);
    for (const noise::Quantity& quantity : quantities) {
      for (std::size_t i = 0; i < std::size(kWanted); ++i) {
        if (quantity.name != kWanted[i]) continue;
        value[i] = shown(quantity, 1.0, 3);
        unit[i] = with_roots(quantity.unit);
      }
      if (quantity.process.rfind("GM", 0) != 0)
        continue;  // in order of falling rate: the last is the slowest
      if (quantity.name == "sd") {
        std::string sd_unit = quantity.unit;
        const double factor = shown_unit(sd_unit);
        slow_sd = shown(quantity, factor, 3);
        if (quantity.knowledge == noise::Knowledge::kFitted) slow_sd += text(" " + sd_unit);
      }
      if (quantity.name == "correlation time") slow_time = shown(quantity, 1.0, 2);
    }
    const std::size_t walk = noise::is_gyro(axis.unit) ? 0 : 1;
    table.add_row({text(axis_words(axis.axis)), value[walk], text(unit[walk]), value[2], text(unit[2]),
                   slow_sd, slow_time});
  }
  return table.empty() ? Html{} : table.html();
}

Html exports(const std::vector<noise::AxisFit>& fits) {
  Html all;
  for (const auto& [format, name] : kFormats) {
    const auto exported = noise::export_models(fits, format);
    const Html content =
        exported ? element("pre", text(*exported)) : paragraph(exported.error().text(), "note");
    all += element("details", element("summary", text(name)) + content);
  }
  return all;
}

}  // namespace

Html take_away_section(const RunFiles& run, const std::vector<Fit>& all_fits) {
  Html section = heading("take-away", "Models to take away");
  if (!run.models.is_array() || run.models.empty()) {
    return section + paragraph("No noise model in this run: there is nothing to take away.");
  }
  section += paragraph(
      "In the terms of data sheets, and as the configuration of other tools. `imuscope export models.json` "
      "writes the same as files, the whole model as state space, and with --conservative the upper ends of "
      "the intervals. What does not hold is not written, with the reason in its place.");
  std::vector<std::pair<std::string, std::string>> parts;
  for (const SImuFiles& study : run.studies) {
    for (const std::string& regime : particular_regimes(regimes_of(all_fits)))
      parts.emplace_back(study.name, regime);
  }
  // What a filter feels of a model takes a while to find: each part by itself, on any thread.
  std::vector<Html> made(parts.size());
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
    const auto& [name, regime] = parts[i];
    const auto fits = axis_fits(run, name, regime);
    if (fits.empty()) return;
    made[i] = fold(name + ", " + (regime.empty() ? "all" : regime), quantity_table(fits) + exports(fits));
  });
  for (const Html& part : made) section += part;
  return section;
}

}  // namespace imuscope::report
