#pragma once

/// GREIS messages of a GNSS rover, from the GREIS reference guide. Bodies are little-endian.

#include <cstdint>
#include <span>
#include <string_view>

#include "firmware_sim/devices/bytes.h"

namespace imusim::greis {

/// Solution types.
inline constexpr std::uint8_t kNoSolution = 0;
inline constexpr std::uint8_t kRtkFixed = 4;

/// Two id characters, three hexadecimal digits of length, body, and the checksum as the body's last byte.
/// @param body  without the checksum
Bytes message(std::string_view id, std::span<const std::uint8_t> body);

/// The guide's checksum: rotate left by two, exclusive or.
std::uint8_t checksum(std::span<const std::uint8_t> bytes);

/// One epoch's solution, at the antenna.
struct Solution {
  std::uint32_t time_of_day_ms = 0;  ///< in the base of `date_base`
  std::uint16_t year = 0;
  std::uint8_t month = 0;
  std::uint8_t day = 0;
  std::uint8_t date_base = 0;  ///< 0 GPS, 1 UTC(USNO)
  std::uint8_t type = kRtkFixed;
  double latitude_rad = 0.0;
  double longitude_rad = 0.0;
  double height_m = 0.0;
  float position_sd_m = 0.0F;  ///< three-dimensional
  float north_mps = 0.0F;
  float east_mps = 0.0F;
  float up_mps = 0.0F;
  float velocity_sd_mps = 0.0F;  ///< three-dimensional
  float horizontal_position_sd_m = 0.0F;
  float vertical_position_sd_m = 0.0F;
  float horizontal_velocity_sd_mps = 0.0F;
  float vertical_velocity_sd_mps = 0.0F;
  float hdop = 0.7F;
  float vdop = 1.1F;
  float tdop = 0.5F;
  float edop = 0.5F;
};

/// Body of the message with this id (RT, RD, ST, PG, VG, SG, DP or ET), ready to send. Empty for any other
/// id. On the wire RT is called ~~ and ET ::.
Bytes encode(std::string_view name, const Solution& solution);

}  // namespace imusim::greis
