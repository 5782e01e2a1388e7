#pragma once

/// Position, velocity and time of one epoch as u-blox receivers compute them (NAV-PVT). XSens devices with a
/// receiver inside pass the same numbers on.
///
/// Standard deviations: hacc is of the plane, so each of north and east gets 1/sqrt(2) of it; sacc is of the
/// whole velocity vector, each axis gets 1/sqrt(3).

#include <cstdint>
#include <optional>

#include "sample/sample.h"

namespace imuscope {

/// In wire units.
struct NavPvt {
  std::uint32_t itow;  ///< ms of the GPS week: the navigation epoch
  std::uint16_t year;
  std::uint8_t month, day, hour, minute, sec;
  std::uint8_t valid;
  std::uint32_t tacc;  ///< ns
  std::int32_t nano;   ///< remainder of the UTC second, may be negative
  std::uint8_t fix, flags, flags2, nsv;
  std::int32_t lon, lat;     ///< 1e-7 deg
  std::int32_t h, hmsl;      ///< mm above ellipsoid and mean sea level
  std::uint32_t hacc, vacc;  ///< mm
  std::int32_t vn, ve, vd;   ///< mm/s
  std::int32_t gs;           ///< mm/s
  std::int32_t hm;           ///< 1e-5 deg
  std::uint32_t sacc;        ///< mm/s
  std::uint32_t hda;         ///< 1e-5 deg
  std::uint16_t pdop;        ///< 0.01
};

// NavPvt::valid
inline constexpr std::uint8_t kPvtDateValid = 1U << 0U;
inline constexpr std::uint8_t kPvtTimeValid = 1U << 1U;
// NavPvt::flags
inline constexpr std::uint8_t kPvtFixOk = 1U << 0U;
inline constexpr std::uint8_t kPvtDifferential = 1U << 1U;
inline constexpr unsigned kPvtCarrierShift = 6;  ///< two bits: 0 none, 1 float, 2 fixed
// NavPvt::fix
inline constexpr std::uint8_t kPvtFix3D = 3;
inline constexpr std::uint8_t kPvtFixWithDeadReckoning = 4;

/// Nothing where date or time are not valid.
[[nodiscard]] std::optional<UtcTime> utc_of(const NavPvt& pvt) noexcept;

[[nodiscard]] GnssData gnss_of(const NavPvt& pvt) noexcept;

/// Time of the GPS week, unwrapped through its end.
class WeekTime {
 public:
  /// False for what is no time of week, and for an epoch that came twice.
  [[nodiscard]] bool take(std::uint32_t itow_ms) noexcept;
  [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ms_ * 1'000'000; }
  /// Epochs that are missing before the last one taken.
  /// @param period  between epochs; zero: not known, none is missing
  [[nodiscard]] std::uint64_t missing(Duration period) const noexcept;

 private:
  std::optional<std::uint32_t> last_itow_ms_;
  std::int64_t time_ms_ = 0;
  std::int64_t step_ms_ = 0;
};

}  // namespace imuscope
