#pragma once

/// iXblue StdBin telegrams, version 3, with the blocks that the simulated unit sends. Axes of the wire: XV1
/// forward, XV2 port, XV3 up; roll positive port side up, pitch positive bow down, heading clockwise from
/// north.

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "firmware_sim/devices/bytes.h"

namespace imusim::stdbin {

struct Position {
  double latitude_deg;
  double longitude_deg;  ///< [0, 360)
  double altitude_m;     ///< above the ellipsoid
};

struct PositionSd {
  double north_m;
  double east_m;
  double north_east_m2;  ///< covariance
  double altitude_m;
};

struct Date {
  std::uint8_t day;
  std::uint8_t month;
  std::uint16_t year;
};

/// One telegram. A block that is absent is not sent.
struct Telegram {
  std::uint32_t validity_100us = 0;  ///< time of day, UTC
  std::uint32_t counter = 0;
  // Navigation blocks, by mask bit.
  std::optional<Eigen::Vector3d> heading_roll_pitch_deg;      ///< 0
  std::optional<Eigen::Vector3d> heading_roll_pitch_sd_deg;   ///< 1
  std::optional<Position> position;                           ///< 7
  std::optional<PositionSd> position_sd;                      ///< 8
  std::optional<Eigen::Vector3d> speed_neu_mps;               ///< 9
  std::optional<Eigen::Vector3d> speed_sd_neu_mps;            ///< 10
  std::optional<Date> date;                                   ///< 13
  std::optional<std::array<std::uint32_t, 2>> sensor_status;  ///< 14
  std::optional<std::uint32_t> user_status;                   ///< 17
  std::optional<Eigen::Vector3d> raw_acceleration_mps2;       ///< 28: with gravity
  // Extended navigation blocks.
  std::optional<Eigen::Vector3d> rotation_acceleration_degps2;  ///< 0
  std::optional<Eigen::Vector3d> raw_rotation_rate_degps;       ///< 2: Earth rate included
};

/// Bits of the user status.
inline constexpr std::uint32_t kUserGpsValid = 1U << 1U;
inline constexpr std::uint32_t kUserTimeValid = 1U << 8U;
inline constexpr std::uint32_t kUserHrpInvalid = 1U << 26U;
inline constexpr std::uint32_t kUserAlignment = 1U << 27U;
inline constexpr std::uint32_t kUserNavigation = 1U << 29U;
/// Sensor status 1.
inline constexpr std::uint32_t kSensorDataReady = 1U << 0U;

/// The whole telegram with header and checksum.
Bytes encode(const Telegram& telegram);

}  // namespace imusim::stdbin
