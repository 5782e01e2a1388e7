#include "firmware_sim/devices/greis_encoder.h"

#include <fmt/format.h>
#include <bit>
#include <iterator>
#include <string>

namespace imusim::greis {

std::uint8_t checksum(std::span<const std::uint8_t> bytes) {
  std::uint8_t result = 0;
  for (const std::uint8_t byte : bytes) result = static_cast<std::uint8_t>(std::rotl(result, 2) ^ byte);
  return std::rotl(result, 2);
}

Bytes message(std::string_view id, std::span<const std::uint8_t> body) {
  Bytes bytes;
  put_text(bytes, fmt::format("{}{:03X}", id, body.size() + 1));
  put_bytes(bytes, body);
  bytes.push_back(checksum(bytes));
  return bytes;
}

Bytes encode(std::string_view name, const Solution& solution) {
  Bytes body;
  if (name == "RT" || name == "ET") {
    put_le(body, solution.time_of_day_ms);
    return message(name == "RT" ? "~~" : "::", body);
  }
  if (name == "RD") {
    put_le(body, solution.year);
    put_bytes(body, Bytes{solution.month, solution.day, solution.date_base});
    return message(name, body);
  }
  if (name == "ST") {
    put_le(body, solution.time_of_day_ms);
  } else if (name == "PG") {
    for (const double value : {solution.latitude_rad, solution.longitude_rad, solution.height_m})
      put_le(body, value);
    put_le(body, solution.position_sd_m);
  } else if (name == "VG") {
    for (const float value :
         {solution.north_mps, solution.east_mps, solution.up_mps, solution.velocity_sd_mps})
      put_le(body, value);
  } else if (name == "SG") {
    for (const float value : {solution.horizontal_position_sd_m, solution.vertical_position_sd_m,
                              solution.horizontal_velocity_sd_mps, solution.vertical_velocity_sd_mps})
      put_le(body, value);
  } else if (name == "DP") {
    for (const float value : {solution.hdop, solution.vdop, solution.tdop}) put_le(body, value);
  } else {
    return {};
  }
  body.push_back(solution.type);
  if (name == "DP") put_le(body, solution.edop);
  return message(name, body);
}

}  // namespace imusim::greis
