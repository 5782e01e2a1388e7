#include "fleet/unit_task.h"

#include <fmt/format.h>

#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>
#include <vector>

#include "base/json_text.h"
#include "base/output_folder.h"
#include "fleet/measurement_row.h"
#include "fleet/study_task.h"
#include "models/noise/random_effects.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"
#include "study/combination.h"

namespace imuscope::fleet {
namespace {

using nlohmann::json;
using tables::field;
using tables::text_at;
namespace fs = std::filesystem;

constexpr double kConfidence = 0.95;
fs::path file_of(const UnitTask& task) { return task.out / "units" / (task.key + ".json"); }

/// The studies that the result is made of, with what became of them.
json inputs_of(const UnitTask& task) {
  json inputs = json::array();
  for (const auto& drive : task.drives)
    inputs.push_back({drive.study_key, drive.device, key_of(study_state(task.out, drive.study_key).state)});
  return inputs;
}

struct Values {
  std::vector<double> values;
  std::vector<double> variances;
};
/// Quantity, regime, axis, unit, whether a logarithm.
using Name = std::tuple<std::string, std::string, std::string, std::string, bool>;

json row_of(const Name& name, const Values& all) {
  const auto& [quantity, regime, axis, unit, is_log] = name;
  json row{{"quantity", quantity}, {"regime", regime}, {"axis", axis},
           {"unit", unit},         {"is_log", is_log}, {"drives", all.values.size()}};
  if (const auto effects = noise::random_effects(all.values, all.variances, kConfidence)) {
    row["mean"] = effects->mean;
    row["mean_low"] = effects->ci_low;
    row["mean_high"] = effects->ci_high;
    row["drive_sd"] = effects->spread;
    row["drive_sd_low"] = effects->spread_low;
    row["drive_sd_high"] = effects->spread_high;
  } else {
    row["mean"] = all.values.front();
    for (const char* key : {"mean_low", "mean_high", "drive_sd", "drive_sd_low", "drive_sd_high"})
      row[key] = nullptr;
  }
  return row;
}

/// Drives of one mounting campaign in which the unit was one device.
json mounting_of_drives(const std::string& mounting, const std::string& device,
                        const std::vector<fs::path>& runs) {
  json out{{"mounting", mounting},
           {"device", device},
           {"drives", runs.size()},
           {"combined", nullptr},
           {"why_not", ""}};
  std::vector<DriveMountings> drives;
  for (const auto& run : runs) {
    auto drive = read_mountings(run);
    if (!drive) continue;
    std::erase_if(drive->studies, [&](const auto& study) { return study.name != device; });
    if (!drive->studies.empty()) drives.push_back(std::move(*drive));
  }
  if (drives.size() < 2) {
    out["why_not"] = "fewer than two drives tell the mounting";
    return out;
  }
  const auto combined = combine_drives(drives, CombineMethod::kInverseVariance);
  if (!combined) {
    out["why_not"] = combined.error().text();
    return out;
  }
  json document = combination_json(*combined);
  for (json& imu : document["imus"]) {
    // Paths of this campaign's folder are no result.
    imu.erase("drives");
    if (text_at(imu, "name") == device) out["combined"] = std::move(imu);
  }
  return out;
}

}  // namespace

bool unit_is_done(const UnitTask& task) {
  const json result = tables::read_json_file(file_of(task));
  return text_at(result, "schema") == kUnitSchema && field(result, "inputs") == inputs_of(task);
}

Result<void> do_unit(const UnitTask& task, const std::string& program) {
  if (unit_is_done(task)) return {};
  return tables::with_documents_of(task.out, [&]() -> Result<void> {
    json inputs = inputs_of(task);
    std::map<Name, Values> values;
    std::map<std::pair<std::string, std::string>, std::vector<fs::path>> runs;
    for (const auto& drive : task.drives) {
      const fs::path study = task.out / "studies" / drive.study_key;
      const json result = tables::read_json_file(study / "result.json");
      for (const json& one : field(field(result, "summary"), "imus")) {
        if (text_at(one, "device") != drive.device) continue;
        runs[{drive.mounting, drive.device}].push_back(study / "run");
        for (const auto& row : measurements_of(one)) {
          Values& all = values[{row.quantity, row.regime, row.axis, row.unit, row.is_log}];
          all.values.push_back(row.value);
          all.variances.push_back(row.sd * row.sd);
        }
      }
    }
    json result{{"schema", kUnitSchema},       {"key", task.key},
                {"unit", task.unit},           {"program", program},
                {"inputs", std::move(inputs)}, {"quantities", json::array()},
                {"mountings", json::array()}};
    for (const auto& [name, all] : values) result["quantities"].push_back(row_of(name, all));
    for (const auto& [place, folders] : runs)
      result["mountings"].push_back(mounting_of_drives(place.first, place.second, folders));
    const auto out = OutputFolder::open(task.out);
    if (!out) return tl::unexpected<Error>(out.error());
    const auto units = out->sub_folder("units");
    if (!units) return tl::unexpected<Error>(units.error());
    return units->write_whole(task.key + ".json", json_text(result, kJsonOneLine) + "\n");
  });
}

}  // namespace imuscope::fleet
