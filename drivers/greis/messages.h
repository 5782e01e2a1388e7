#pragma once

/// Bodies of the messages that are read, in wire units: SI and radians, but for times in milliseconds.
/// `soltype` is 1 single, 2 code differential, 3 RTK float, 4 RTK fixed; any other is taken for no solution.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/greis/wire.h"

namespace imuscope::greis {

using Body = std::span<const std::uint8_t>;

/// [~~] (RT) opens and [::] (ET) closes an epoch: receiver time of day, in the time base of [RD].
struct TimeOfDay {
  std::uint32_t tod_ms;
};
/// [RD]: date of the receiver's time and the base that its times of day are in; sent at start and when it
/// changes.
struct ReceiverDate {
  std::uint16_t year;
  std::uint8_t month;
  std::uint8_t day;
  std::uint8_t base;  ///< TimeBase
};
/// [GT]: GPS time.
struct GpsTime {
  std::uint32_t tow_ms;  ///< of the week
  std::uint16_t wn;      ///< modulo 1024
};
/// [TO]: reference time = receiver time + offset, as found at this epoch and smoothed.
struct TimeOffset {
  double val_s;
  double sval_s;
};
/// [UO], of which only the leap seconds in force are read: GPS time minus UTC.
struct UtcOffset {
  std::int8_t leap_s;
};
/// [ST]: time of day for which the solution of this epoch holds.
struct SolutionTime {
  std::uint32_t time_ms;  ///< of the epoch that the position belongs to; may be before RT (delayed RTK)
  std::uint8_t soltype;
};
/// [PO]: position of the antenna, Earth-centred (ECEF).
struct PositionEcef {
  std::array<double, 3> xyz_m;
  float psigma;  ///< m, spherical error probable
  std::uint8_t soltype;
};
/// [VE]: velocity of the antenna along the axes of ECEF.
struct VelocityEcef {
  std::array<float, 3> v_mps;
  float vsigma;  ///< m/s, spherical error probable
  std::uint8_t soltype;
};
/// [PV]: [PO] and [VE] in one message, which share one solution type.
struct PositionVelocityEcef {
  PositionEcef position;
  VelocityEcef velocity;
};
/// [PG]: position of the antenna, geodetic.
struct PositionGeodetic {
  double lat_rad;
  double lon_rad;
  double alt_m;  ///< above the ellipsoid
  float psigma;  ///< m, spherical error probable
  std::uint8_t soltype;
};
/// [VG]: velocity of the antenna along north, east and up.
struct VelocityGeodetic {
  float north;  ///< m/s, as the next two
  float east;
  float up;
  float vsigma;  ///< m/s, spherical error probable
  std::uint8_t soltype;
};
/// [SG]: standard deviations of position and velocity. The horizontal ones are those of the plane, sqrt(2)
/// times that of each axis.
struct Sigmas {
  float hpos;  ///< m, as the next one
  float vpos;
  float hvel;  ///< m/s, as the next one
  float vvel;
  std::uint8_t soltype;
};
/// [DP]: dilutions of precision; old firmware sends it without the one of east.
struct Dop {
  float hdop;
  float vdop;
  float tdop;
  std::uint8_t soltype;
  bool has_edop;
  float edop;
};
/// [SP] of position, [SV] of velocity; in the order of kCovarianceNames.
struct Covariance {
  std::array<float, 10> values;
  std::uint8_t soltype;
};
inline constexpr std::array<std::string_view, 10> kCovarianceNames{"xx", "yy", "zz", "tt", "xy",
                                                                   "xz", "xt", "yz", "yt", "zt"};

// Each parser wants a body of at least body_min() bytes, as the scanner lets through.
[[nodiscard]] TimeOfDay parse_time_of_day(Body body) noexcept;
[[nodiscard]] ReceiverDate parse_receiver_date(Body body) noexcept;
[[nodiscard]] GpsTime parse_gps_time(Body body) noexcept;
[[nodiscard]] TimeOffset parse_time_offset(Body body) noexcept;
[[nodiscard]] UtcOffset parse_utc_offset(Body body) noexcept;
[[nodiscard]] SolutionTime parse_solution_time(Body body) noexcept;
[[nodiscard]] PositionEcef parse_position_ecef(Body body) noexcept;
[[nodiscard]] VelocityEcef parse_velocity_ecef(Body body) noexcept;
[[nodiscard]] PositionVelocityEcef parse_position_velocity_ecef(Body body) noexcept;
[[nodiscard]] PositionGeodetic parse_position_geodetic(Body body) noexcept;
[[nodiscard]] VelocityGeodetic parse_velocity_geodetic(Body body) noexcept;
[[nodiscard]] Sigmas parse_sigmas(Body body) noexcept;
[[nodiscard]] Dop parse_dop(Body body) noexcept;
[[nodiscard]] Covariance parse_covariance(Body body) noexcept;

/// Value of one named field of a message, for those who list messages.
struct NamedValue {
  std::string_view name;
  double number;  ///< every integer of the protocol is exact in a double
  bool is_integer;
};

/// Calls visit(const NamedValue&) for each field of a message that is read; nothing for others.
template <typename Visit>
void for_each_field(std::uint16_t id, Body body, Visit&& visit) {
  const auto integer = [&](std::string_view name, auto value) {
    visit(NamedValue{name, static_cast<double>(value), true});
  };
  const auto real = [&](std::string_view name, auto value) {
    visit(NamedValue{name, static_cast<double>(value), false});
  };
  const auto position = [&](const PositionEcef& p) {
    real("x", p.xyz_m[0]), real("y", p.xyz_m[1]), real("z", p.xyz_m[2]), real("psigma", p.psigma);
  };
  const auto velocity = [&](const VelocityEcef& v) {
    real("vx", v.v_mps[0]), real("vy", v.v_mps[1]), real("vz", v.v_mps[2]), real("vsigma", v.vsigma);
  };
  switch (id) {
    case kReceiverTime:
    case kEpochTime:
      integer("tod_ms", parse_time_of_day(body).tod_ms);
      break;
    case kReceiverDate: {
      const ReceiverDate date = parse_receiver_date(body);
      integer("year", date.year), integer("month", date.month), integer("day", date.day);
      integer("base", date.base);
      break;
    }
    case kGpsTime: {
      const GpsTime time = parse_gps_time(body);
      integer("tow_ms", time.tow_ms), integer("wn", time.wn);
      break;
    }
    case kTimeOffset: {
      const TimeOffset offset = parse_time_offset(body);
      real("val_s", offset.val_s), real("sval_s", offset.sval_s);
      break;
    }
    case kUtcOffset:
      integer("leap_s", parse_utc_offset(body).leap_s);
      break;
    case kSolutionTime: {
      const SolutionTime time = parse_solution_time(body);
      integer("time_ms", time.time_ms), integer("soltype", time.soltype);
      break;
    }
    case kPositionEcef: {
      const PositionEcef p = parse_position_ecef(body);
      position(p), integer("soltype", p.soltype);
      break;
    }
    case kVelocityEcef: {
      const VelocityEcef v = parse_velocity_ecef(body);
      velocity(v), integer("soltype", v.soltype);
      break;
    }
    case kPositionVelocityEcef: {
      const PositionVelocityEcef pv = parse_position_velocity_ecef(body);
      position(pv.position), velocity(pv.velocity), integer("soltype", pv.position.soltype);
      break;
    }
    case kPositionGeodetic: {
      const PositionGeodetic p = parse_position_geodetic(body);
      real("lat_rad", p.lat_rad), real("lon_rad", p.lon_rad), real("alt_m", p.alt_m);
      real("psigma", p.psigma), integer("soltype", p.soltype);
      break;
    }
    case kVelocityGeodetic: {
      const VelocityGeodetic v = parse_velocity_geodetic(body);
      real("north", v.north), real("east", v.east), real("up", v.up), real("vsigma", v.vsigma);
      integer("soltype", v.soltype);
      break;
    }
    case kSigmas: {
      const Sigmas s = parse_sigmas(body);
      real("hpos", s.hpos), real("vpos", s.vpos), real("hvel", s.hvel), real("vvel", s.vvel);
      integer("soltype", s.soltype);
      break;
    }
    case kDop: {
      const Dop dop = parse_dop(body);
      real("hdop", dop.hdop), real("vdop", dop.vdop), real("tdop", dop.tdop);
      integer("soltype", dop.soltype);
      if (dop.has_edop) real("edop", dop.edop);
      break;
    }
    case kPositionCovariance:
    case kVelocityCovariance: {
      const Covariance covariance = parse_covariance(body);
      for (std::size_t i = 0; i < kCovarianceNames.size(); ++i) {
        real(kCovarianceNames[i], covariance.values[i]);
      }
      integer("soltype", covariance.soltype);
      break;
    }
    default:
      break;
  }
}

}  // namespace imuscope::greis
