#include "estimation/calibration/gnss_trust.h"

#include <algorithm>
#include <cmath>

#include "estimation/navigation/gnss_gate.h"
#include "sample/eigen_arrays.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

/// E-18: how long the error of a solution stays much the same. Ambiguities of a float solution settle over
/// half a minute. The autocorrelation of recorded single positions bends at about one minute and then falls
/// slowly (D. L. Wilson's twenty-day records, "Correlation of errors"), as reflections change within a
/// minute, and what orbits, clocks and the atmosphere leave within many (differenced phases: 5 to 20 min,
/// Howind et al. 1999). Corrections take most of the slow part away.
constexpr double kFloatCorrelation_s = 30.0;
constexpr double kDifferentialCorrelation_s = 60.0;
constexpr double kSingleCorrelation_s = 120.0;

double correlation_s(GnssSolution solution) noexcept {
  switch (solution) {
    case GnssSolution::kFixed:
      return 0.0;
    case GnssSolution::kFloat:
      return kFloatCorrelation_s;
    case GnssSolution::kDifferential:
      return kDifferentialCorrelation_s;
    case GnssSolution::kSingle:
    case GnssSolution::kNone:
      break;
  }
  return kSingleCorrelation_s;
}

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

Vector3d trusted_sd(bool given, const Vector3& reported, const Vector3& fallback, const Vector3& floor,
                    GnssSolution solution) noexcept {
  // An sd that is no number is none: the floor alone would trust that solution most of all.
  const bool usable = given && to_eigen(reported).allFinite();
  const Vector3d sd = usable ? to_eigen(reported) : Vector3d(sd_factor(solution) * to_eigen(fallback));
  return floored_sd(sd, to_eigen(floor));
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
  if (since_last_s <= 0.0) return 1.0;
  return std::sqrt(std::max(1.0, 2.0 * correlation_s(solution) / since_last_s));
}

}  // namespace imuscope
