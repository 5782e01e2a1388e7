#include <fmt/format.h>

#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

using nlohmann::json;

/// A mean NEES, marked where 95 % of right models do not lie.
Html nees_cell(const json& row, const char* key) {
  const auto nees = number_at(row, key);
  const auto low = number_at(row, "nees_low");
  const auto high = number_at(row, "nees_high");
  if (!nees || !low || !high) return text(kUnknown);
  Html value = number(*nees, 3);
  if (*nees > *high) return element("strong", value + text(" ▲"), "no");
  if (*nees < *low) return element("strong", value + text(" ▼"), "partly");
  return value;
}

Html outage_table(const RunFiles& run, const std::string& imu) {
  Table table({text("model"), text("error, m"), text("predicted sd, m"), text("ratio"), text("NEES position"),
               text("velocity"), text("attitude"), text("95 % of a right one"), text("surprise"),
               text("outages")});
  for (const json& duration : field(run.evaluation, "durations_s")) {
    bool named = false;
    for (const json& row : field(run.evaluation, "evaluations")) {
      if (text_at(row, "name") != imu || field(row, "duration_s") != duration) continue;
      if (!named)
        table.add_group(text(fmt::format("after {:g} s", number_at(row, "duration_s").value_or(0.0))));
      named = true;
      const auto error = number_at(row, "horizontal_rms_m");
      const auto sd = number_at(row, "horizontal_sd_m");
      table.add_row(
          {text(text_at(row, "model")), number(error, 3), number(sd, 3),
           error && sd && *sd > 0.0 ? number(*error / *sd, 3) : text(kUnknown),
           nees_cell(row, "nees_position"), nees_cell(row, "nees_velocity"), nees_cell(row, "nees_attitude"),
           number(number_at(row, "nees_low"), 2) + text(" – ") + number(number_at(row, "nees_high"), 2),
           number(number_at(row, "surprise"), 3),
           count(number_at(row, "n_independent")) + text(" / ") + count(number_at(row, "n"))});
    }
  }
  return table.empty() ? Html{} : table.html();
}

Html absent_models(const RunFiles& run, const std::string& imu) {
  Html items;
  for (const json& entry : field(run.evaluation, "absent")) {
    if (text_at(entry, "name") == imu)
      items += element("li", text(text_at(entry, "model") + ": " + text_at(entry, "why")));
  }
  return items.empty() ? Html{} : element("ul", items, "note");
}

}  // namespace

Html outages_section(const RunFiles& run) {
  Html section = heading("outages", "Does it matter? Coasting through GNSS outages");
  if (run.evaluation.is_null()) {
    return section + paragraph(
                         "No evaluation.json in this run: `imuscope evaluate` on this "
                         "folder puts the models to the test.");
  }
  section += paragraph(
      "The S-IMU alone navigates with GNSS, loses it, and is held against the reference after each "
      "duration. Error: root mean square of the horizontal position; predicted sd: what the filter "
      "thought of it. NEES: mean squared error in units of the predicted covariance, per degree of "
      "freedom: 1 where the model is right; ▲ the filter trusts itself too much, ▼ too little. Surprise: "
      "mean −log density of the position error; the model with the smallest predicts best. Outages: "
      "those that do not overlap / all.");
  for (const SImuFiles& study : run.studies) {
    section +=
        element("h3", text(study.name)) + outage_table(run, study.name) + absent_models(run, study.name);
  }
  return section;
}

}  // namespace imuscope::report
