#pragma once

/// Which columns of anyone's log are the axes of an IMU, and in which units, by their names.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "models/noise/quantities.h"

namespace imuscope::cli {

struct AxisColumn {
  std::string axis;                                   ///< "gyro_x", "accel_z"
  std::string column;                                 ///< its name in the file; of a raw file empty
  noise::SignalUnit unit = noise::SignalUnit::kNone;  ///< kNone: the name does not say
  double factor = 1.0;                                ///< to that unit, of thousandths of g
};

/// Axis and unit of a name such as "gyro_x_radps", "AngularVelocity.X (deg/s)", "imu.linear_acceleration.z",
/// "acc_y [mg]", "wx", "az". Absent where it names neither a rate nor a force, or no axis.
std::optional<AxisColumn> axis_of_name(std::string_view name);

/// "temp", "temperature_c", "Temp (degC)".
bool is_temperature_name(std::string_view name);

/// The header of a CSV file; empty where its first line is numbers. Errors as read_signal().
Result<std::vector<std::string>> header_of(const std::filesystem::path& file);

}  // namespace imuscope::cli
