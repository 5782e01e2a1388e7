#include "drivers/device/nav_pvt.h"

#include <chrono>
#include <numbers>

#include "base/units.h"
#include "drivers/device/calendar.h"

namespace imuscope {
namespace {

constexpr double kDegPerCount = 1e-7;
constexpr double kMetrePerMm = 1e-3;
constexpr std::int64_t kMsPerWeek = 604'800'000;

GnssSolution solution_of(const NavPvt& pvt) noexcept {
  const bool fixed_in_space = pvt.fix == kPvtFix3D || pvt.fix == kPvtFixWithDeadReckoning;
  if ((pvt.flags & kPvtFixOk) == 0 || !fixed_in_space) return GnssSolution::kNone;
  switch (pvt.flags >> kPvtCarrierShift) {
    case 1:
      return GnssSolution::kFloat;
    case 2:
      return GnssSolution::kFixed;
    default:
      break;
  }
  return (pvt.flags & kPvtDifferential) != 0 ? GnssSolution::kDifferential : GnssSolution::kSingle;
}

}  // namespace

std::optional<UtcTime> utc_of(const NavPvt& pvt) noexcept {
  constexpr std::uint8_t kBoth = kPvtDateValid | kPvtTimeValid;
  const auto days = days_since_1970(pvt.year, pvt.month, pvt.day);
  if ((pvt.valid & kBoth) != kBoth || !days) return std::nullopt;
  return UtcTime{std::chrono::days(*days)} + std::chrono::hours(pvt.hour) + std::chrono::minutes(pvt.minute) +
         std::chrono::seconds(pvt.sec) + Duration(pvt.nano);
}

GnssData gnss_of(const NavPvt& pvt) noexcept {
  GnssData gnss{};
  gnss.solution = solution_of(pvt);
  if (gnss.solution == GnssSolution::kNone) return gnss;
  gnss.latitude_rad = pvt.lat * kDegPerCount * kRadPerDeg;
  gnss.longitude_rad = pvt.lon * kDegPerCount * kRadPerDeg;
  gnss.height_m = pvt.h * kMetrePerMm;
  gnss.v_n_mps = {pvt.vn * kMetrePerMm, pvt.ve * kMetrePerMm, pvt.vd * kMetrePerMm};
  gnss.flags = kPositionValid | kVelocityValid;
  if (pvt.hacc > 0 && pvt.vacc > 0) {
    const double one_axis_m = pvt.hacc * kMetrePerMm / std::numbers::sqrt2;
    gnss.sd_position_m = {one_axis_m, one_axis_m, pvt.vacc * kMetrePerMm};
    gnss.flags |= kHasPositionSd;
  }
  if (pvt.sacc > 0) {
    const double one_axis_mps = pvt.sacc * kMetrePerMm / std::numbers::sqrt3;
    gnss.sd_velocity_mps = {one_axis_mps, one_axis_mps, one_axis_mps};
    gnss.flags |= kHasVelocitySd;
  }
  return gnss;
}

bool WeekTime::take(std::uint32_t itow_ms) noexcept {
  if (itow_ms >= kMsPerWeek) return false;
  if (last_itow_ms_) {
    std::int64_t step = static_cast<std::int64_t>(itow_ms) - static_cast<std::int64_t>(*last_itow_ms_);
    if (step < -kMsPerWeek / 2) step += kMsPerWeek;
    if (step > kMsPerWeek / 2) step -= kMsPerWeek;
    if (step == 0) return false;
    step_ms_ = step;
    time_ms_ += step;
  } else {
    time_ms_ = itow_ms;
  }
  last_itow_ms_ = itow_ms;
  return true;
}

std::uint64_t WeekTime::missing(Duration period) const noexcept {
  const auto period_ms = std::chrono::duration_cast<std::chrono::milliseconds>(period).count();
  if (period_ms <= 0 || 2 * step_ms_ <= 3 * period_ms) return 0;
  return static_cast<std::uint64_t>((step_ms_ + period_ms / 2) / period_ms - 1);
}

}  // namespace imuscope
