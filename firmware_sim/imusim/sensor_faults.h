#pragma once

/// What the faults of a script make of what a device measures.

#include <optional>
#include <vector>

#include "firmware_sim/devices/greis_encoder.h"
#include "firmware_sim/faults/fault.h"
#include "firmware_sim/imu/imu_model.h"

namespace imusim {

class SensorFaults {
 public:
  /// @param faults  of one device; those of other layers are passed over
  explicit SensorFaults(std::vector<Fault> faults) : faults_(std::move(faults)), stuck_(faults_.size()) {}

  /// Readings must come in the order of time.
  void apply(double t_s, ImuReading& reading);
  void apply(double t_s, greis::Solution& solution) const;

 private:
  std::vector<Fault> faults_;
  std::vector<std::optional<ImuReading>> stuck_;  ///< what each fault holds
};

}  // namespace imusim
