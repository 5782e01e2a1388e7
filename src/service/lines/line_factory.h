#pragma once

/// From a device's configuration to its line. The one place that knows every kind of line.

#include <memory>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "drivers/device/can_frame.h"
#include "drivers/transport/transport.h"

namespace imuscope {

/// Whether the configuration says how the device is connected; without a line it exists only as a file.
[[nodiscard]] bool has_line(const DeviceConfig& device);

/// Opens the line of a device that has one. Not for the real-time thread.
/// @param ids  what the device's decoder needs, on a CAN bus
/// Errors name the line and the remedy.
[[nodiscard]] Result<std::unique_ptr<Transport>> open_line(const DeviceConfig& device,
                                                           const std::vector<CanId>& ids);

}  // namespace imuscope
