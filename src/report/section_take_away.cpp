#include <fmt/format.h>
#include <algorithm>
#include <map>

#include "noise/export.h"
#include "noise/json.h"
#include "noise/quantities.h"
#include "report/json_fields.h"
#include "report/people.h"
#include "report/sections.h"

namespace imuscope::report {
namespace {

using nlohmann::json;

constexpr std::pair<noise::ExportFormat, const char*> kFormats[] = {
    {noise::ExportFormat::kKalibr, "kalibr"},
    {noise::ExportFormat::kRos, "ros"},
    {noise::ExportFormat::kPx4, "px4"},
    {noise::ExportFormat::kKfGins, "kf-gins"}};

/// The fits of one sensor in one regime that can be exported.
std::vector<noise::AxisFit> axis_fits(const RunFiles& run, const std::string& imu,
                                      const std::string& regime) {
  std::vector<noise::AxisFit> fits;
  for (const json& entry : run.models) {
    if (text_at(entry, "name") != imu || text_at(entry, "regime") != regime) continue;
    auto fit = noise::fit_from_json(entry);
    const auto unit = noise::parse_unit(text_at(entry, "unit"));
    if (fit && unit) fits.push_back({text_at(entry, "axis"), *unit, std::move(*fit)});
  }
  return fits;
}

/// What data sheets name, axis by axis.
Html quantity_table(const std::vector<noise::AxisFit>& fits) {
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
        value[i] = number(quantity.value, 3);
        unit[i] = quantity.unit;
      }
      if (quantity.process.rfind("GM", 0) != 0)
        continue;  // in order of falling rate: the last is the slowest
      if (quantity.name == "sd") slow_sd = number(quantity.value, 3) + text(" " + quantity.unit);
      if (quantity.name == "correlation time") slow_time = number(quantity.value, 3);
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
    const auto exported = noise::export_models(fits, format, false);
    const Html content =
        exported ? element("pre", text(*exported)) : paragraph(exported.error().text(), "note");
    all += element("details", element("summary", text(name)) + content);
  }
  return all;
}

std::vector<std::string> regimes_in(const RunFiles& run, const std::string& imu) {
  std::vector<std::string> regimes;
  for (const json& entry : run.models) {
    const std::string regime = text_at(entry, "regime");
    if (text_at(entry, "name") == imu && std::find(regimes.begin(), regimes.end(), regime) == regimes.end())
      regimes.push_back(regime);
  }
  return regimes;
}

}  // namespace

Html take_away_section(const RunFiles& run) {
  Html section = element("h2", text("Models to take away"));
  if (!run.models.is_array() || run.models.empty()) {
    return section + paragraph("No noise model in this run: there is nothing to take away.");
  }
  section += paragraph(
      "In the terms of data sheets, and as the configuration of other tools. `imuscope export models.json` "
      "writes the same as files, the whole model as state space, and with --conservative models that lie "
      "above "
      "what the data allow.");
  for (const StudyFiles& study : run.studies) {
    for (const std::string& regime : regimes_in(run, study.name)) {
      const auto fits = axis_fits(run, study.name, regime);
      if (fits.empty()) continue;
      section += element("h3", text(study.name + ", " + (regime.empty() ? "all" : regime))) +
                 quantity_table(fits) + exports(fits);
    }
  }
  return section;
}

}  // namespace imuscope::report
