#pragma once

/// A row of "measurements" of a study's result (study_summary.h).

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

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

}  // namespace imuscope::fleet
