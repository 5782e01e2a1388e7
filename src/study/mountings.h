#pragma once

/// The mountings of a run, by its calibration.json.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "logs/bag/bag_writer.h"
#include "logs/bag/mounting_text.h"

namespace imuscope {

/// What a run found of one S-IMU.
struct FoundCalibration {
  bag::Mounting mounting;             ///< t_d_s as the recording's own times need it
  bag::Correction correction;         ///< the same mounting with biases and scales
  std::optional<bag::Triads> triads;  ///< where the batch estimate found them
};

/// Those S-IMUs that have an estimate.
[[nodiscard]] std::vector<FoundCalibration> found_calibrations(const nlohmann::json& calibration);

}  // namespace imuscope
