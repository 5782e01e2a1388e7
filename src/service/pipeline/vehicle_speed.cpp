#include "service/pipeline/vehicle_speed.h"

#include <cmath>

namespace imuscope {

namespace {

double norm(const Vector3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

}  // namespace

std::optional<VehicleSpeed> vehicle_speed(const NavigationOutput& navigation, const OdometryOutput& odometry,
                                          const EstimatorCounters& counters) noexcept {
  if (navigation.status == NavigationStatus::kNavigating)
    return VehicleSpeed{navigation.time, norm(navigation.v_n_mps), norm(navigation.sd_velocity_mps)};
  if (odometry.enabled && counters.odometry_samples > 0)
    return VehicleSpeed{odometry.time, odometry.speed_mps, 0.0};
  return std::nullopt;
}

}  // namespace imuscope
