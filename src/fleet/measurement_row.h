#pragma once

/// A row of "measurements" of a study's result (study_summary.h).

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "results/tables/json_fields.h"

namespace imuscope::fleet {

struct MeasurementRow {
  std::string quantity;
  std::string regime;
  std::string axis;
  std::string unit;  ///< of the value
  bool is_log = false;
  double value = 0.0;
  double sd = 0.0;
};

/// Nothing where the cells are others than study_summary.h writes.
inline std::optional<MeasurementRow> measurement_of(const nlohmann::json& cells) {
  enum Place : std::size_t { kQuantity, kRegime, kAxis, kUnit, kIsLog, kValue, kSd, kCells };
  if (!cells.is_array() || cells.size() != kCells || !cells[kIsLog].is_boolean() ||
      !cells[kValue].is_number() || !cells[kSd].is_number())
    return std::nullopt;
  for (const auto text : {kQuantity, kRegime, kAxis, kUnit})
    if (!cells[text].is_string()) return std::nullopt;
  return MeasurementRow{cells[kQuantity], cells[kRegime], cells[kAxis], cells[kUnit],
                        cells[kIsLog],    cells[kValue],  cells[kSd]};
}

/// All that one entry of "imus" of a study's result tells in numbers: its measurements, and every parameter
/// of its models that the data determine, as a logarithm ("GM1 beta"). Rows that are none are passed over.
inline std::vector<MeasurementRow> measurements_of(const nlohmann::json& imu) {
  enum Place : std::size_t { kProcess, kName, kUnit, kValue, kSd };
  std::vector<MeasurementRow> rows;
  for (const auto& cells : tables::field(imu, "measurements")) {
    if (auto row = measurement_of(cells)) rows.push_back(std::move(*row));
  }
  for (const auto& model : tables::field(imu, "models")) {
    const std::string regime = tables::text_at(model, "regime");
    const std::string axis = tables::text_at(model, "axis");
    for (const auto& p : tables::field(model, "parameters")) {
      if (!p.is_array() || p.size() <= kSd || !p[kValue].is_number() || !p[kSd].is_number()) continue;
      const double value = p[kValue];
      const double sd = p[kSd];
      if (value > 0.0 && sd > 0.0 && std::isfinite(std::log(value)))
        rows.push_back({p[kProcess].get<std::string>() + " " + p[kName].get<std::string>(), regime, axis,
                        p[kUnit].get<std::string>(), true, std::log(value), sd / value});
    }
  }
  return rows;
}

}  // namespace imuscope::fleet
