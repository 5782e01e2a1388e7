#pragma once

/// What is taken of PX4's messages.

#include "logs/flight_log/message_queue.h"
#include "logs/flight_log/record_fields.h"

namespace imuscope::flight_log {

/// Whether messages of that name are taken: sensor_combined, vehicle_imu, sensor_gyro, sensor_accel,
/// sensor_gps, vehicle_gps_position.
[[nodiscard]] bool is_taken_of_px4(std::string_view type) noexcept;

/// Puts one into the queue.
/// @return how much later the accelerometer's values are than the gyro's, s; nothing where the message does
/// not have them apart, or is no message
struct TakenOfPx4 {
  bool is_good = false;
  std::optional<double> accel_lag_s;
};
TakenOfPx4 take_of_px4(std::string_view type, const std::string& topic, const Fields& fields,
                       MessageQueue& queue);

}  // namespace imuscope::flight_log
