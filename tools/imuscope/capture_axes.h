#pragma once

/// Axes of the IMUs of a capture as records, each device by itself.

#include <filesystem>
#include <vector>

#include "base/result.h"
#include "record_files.h"

namespace imuscope::cli {

[[nodiscard]] bool is_capture(const std::filesystem::path& file);

/// One record an IMU, reference and S-IMUs alike, in the order of the configuration that the capture keeps:
/// what the devices sent, by their own clocks; times left out are gaps. `choice.imu` names one of them;
/// empty: all that are there. Errors: a capture that cannot be read, a device that it does not hold (kUsage,
/// those that it holds are named), a capture without IMUs, too few samples, a rate that contradicts the
/// times.
Result<std::vector<SensorRecord>> read_capture_axes(const std::filesystem::path& file,
                                                    const RecordChoice& choice);

}  // namespace imuscope::cli
