#include "estimation/navigation/reference_grade.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/units.h"

namespace imuscope {
namespace {

struct Known {
  double gyro_white_radps_per_sqrt_hz;
  ReferenceGrade grade;
};

constexpr double kPerRootHour = kRadPerDeg / 60.0;
// Tactical MEMS: STIM300 (Sensonor TS1524: .15 deg/sqrt(h), scale 500 ppm, axes 1 mrad), its scale taken twice, as it is
// among the best of its class.
constexpr double kTacticalAxes_rad = 0.05 * kRadPerDeg;
// Industrial MEMS: aligned to 0.1 deg, as their data sheets state (MTx, ADIS16405), scale calibrated to half a per cent.
constexpr double kIndustrialAxes_rad = 0.1 * kRadPerDeg;

constexpr std::array<Known, 3> kKnown{
    {{0.005 * kPerRootHour, kNavigationGrade},
     {0.15 * kPerRootHour, {1e-3, 0.5 * kTacticalAxes_rad, kTacticalAxes_rad}},
     {kIndustrialGyroWhite_radps_per_sqrt_hz, {5e-3, 0.5 * kIndustrialAxes_rad, kIndustrialAxes_rad}}}};

}  // namespace

// N-29
ReferenceGrade reference_grade(double gyro_white_radps_per_sqrt_hz) noexcept {
  const std::size_t next = gyro_white_radps_per_sqrt_hz < kKnown[1].gyro_white_radps_per_sqrt_hz ? 1 : 2;
  const Known& low = kKnown[next - 1];
  const Known& high = kKnown[next];
  const double place = std::log(gyro_white_radps_per_sqrt_hz / low.gyro_white_radps_per_sqrt_hz) /
                       std::log(high.gyro_white_radps_per_sqrt_hz / low.gyro_white_radps_per_sqrt_hz);
  const auto between = [share = std::clamp(place, 0.0, 1.0)](double from, double to) {
    return from * std::pow(to / from, share);
  };
  return {between(low.grade.scale_sd, high.grade.scale_sd),
          between(low.grade.lean_sd_rad, high.grade.lean_sd_rad),
          between(low.grade.triad_sd_rad, high.grade.triad_sd_rad)};
}

}  // namespace imuscope
