#include "calibration/gnss_trust.h"

#include <algorithm>
#include <cmath>

#include "navigation/gnss_gate.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kFloatCorrelation_s = 30.0;

/// Receivers without sd: how much worse than a fixed solution.
double sd_factor(GnssSolution solution) noexcept {
  switch (solution) {
    case GnssSolution::kFixed:
      return 1.0;
    case GnssSolution::kFloat:
      return 15.0;
    case GnssSolution::kDifferential:
      return 50.0;
    case GnssSolution::kSingle:
    case GnssSolution::kNone:
      break;
  }
  return 150.0;
}

Vector3d vector(const Vector3& v) noexcept { return {v[0], v[1], v[2]}; }

Vector3d trusted_sd(bool given, const Vector3& reported, const Vector3& fallback, const Vector3& floor,
                    GnssSolution solution) noexcept {
  // An sd that is no number is none: the floor alone would trust that solution most of all.
  const bool usable = given && vector(reported).allFinite();
  const Vector3d sd = usable ? vector(reported) : Vector3d(sd_factor(solution) * vector(fallback));
  return floored_sd(sd, vector(floor));
}

}  // namespace

Vector3d trusted_position_sd(const GnssData& gnss, const GnssConfig& config) noexcept {
  return trusted_sd((gnss.flags & kHasPositionSd) != 0, gnss.sd_position_m, config.default_sd_position_m,
                    config.floor_sd_position_m, gnss.solution);
}

Vector3d trusted_velocity_sd(const GnssData& gnss, const GnssConfig& config) noexcept {
  return trusted_sd((gnss.flags & kHasVelocitySd) != 0, gnss.sd_velocity_mps, config.default_sd_velocity_mps,
                    config.floor_sd_velocity_mps, gnss.solution);
}

double correlated_sd_factor(GnssSolution solution, double since_last_s) noexcept {
  if (solution != GnssSolution::kFloat || since_last_s <= 0.0) return 1.0;
  return std::sqrt(std::max(1.0, 2.0 * kFloatCorrelation_s / since_last_s));
}

}  // namespace imuscope
