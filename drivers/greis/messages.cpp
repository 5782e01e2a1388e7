#include "drivers/greis/messages.h"

#include "base/bytes.h"

namespace imuscope::greis {
namespace {

std::array<float, 3> three_floats(Body body, std::size_t offset) noexcept {
  return {read_le<float>(body, offset), read_le<float>(body, offset + 4), read_le<float>(body, offset + 8)};
}

std::array<double, 3> three_doubles(Body body) noexcept {
  return {read_le<double>(body, 0), read_le<double>(body, 8), read_le<double>(body, 16)};
}

}  // namespace

TimeOfDay parse_time_of_day(Body body) noexcept { return {read_le<std::uint32_t>(body)}; }

ReceiverDate parse_receiver_date(Body body) noexcept {
  return {read_le<std::uint16_t>(body), body[2], body[3], body[4]};
}

GpsTime parse_gps_time(Body body) noexcept {
  return {read_le<std::uint32_t>(body), read_le<std::uint16_t>(body, 4)};
}

TimeOffset parse_time_offset(Body body) noexcept { return {read_le<double>(body), read_le<double>(body, 8)}; }

// f64 a0, f32 a1, u32 tot, u16 wnt, then the leap seconds of now.
UtcOffset parse_utc_offset(Body body) noexcept { return {read_le<std::int8_t>(body, 18)}; }

SolutionTime parse_solution_time(Body body) noexcept { return {read_le<std::uint32_t>(body), body[4]}; }

PositionEcef parse_position_ecef(Body body) noexcept {
  return {three_doubles(body), read_le<float>(body, 24), body[28]};
}

VelocityEcef parse_velocity_ecef(Body body) noexcept {
  return {three_floats(body, 0), read_le<float>(body, 12), body[16]};
}

PositionVelocityEcef parse_position_velocity_ecef(Body body) noexcept {
  const std::uint8_t soltype = body[44];
  return {{three_doubles(body), read_le<float>(body, 24), soltype},
          {three_floats(body, 28), read_le<float>(body, 40), soltype}};
}

PositionGeodetic parse_position_geodetic(Body body) noexcept {
  const auto p = three_doubles(body);
  return {p[0], p[1], p[2], read_le<float>(body, 24), body[28]};
}

VelocityGeodetic parse_velocity_geodetic(Body body) noexcept {
  const auto v = three_floats(body, 0);
  return {v[0], v[1], v[2], read_le<float>(body, 12), body[16]};
}

Sigmas parse_sigmas(Body body) noexcept {
  return {read_le<float>(body), read_le<float>(body, 4), read_le<float>(body, 8), read_le<float>(body, 12),
          body[16]};
}

Dop parse_dop(Body body) noexcept {
  constexpr std::size_t kSizeWithEdop = 18;
  const bool has_edop = body.size() >= kSizeWithEdop;
  return {read_le<float>(body),
          read_le<float>(body, 4),
          read_le<float>(body, 8),
          body[12],
          has_edop,
          has_edop ? read_le<float>(body, 13) : 0.0F};
}

Covariance parse_covariance(Body body) noexcept {
  Covariance covariance{};
  for (std::size_t i = 0; i < covariance.values.size(); ++i) {
    covariance.values[i] = read_le<float>(body, 4 * i);
  }
  covariance.soltype = body[40];
  return covariance;
}

}  // namespace imuscope::greis
