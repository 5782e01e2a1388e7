#include "firmware_sim/imusim/sensor_faults.h"

#include "firmware_sim/motion/earth.h"

namespace imusim {

void SensorFaults::apply(double t_s, ImuReading& reading) {
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    const Fault& fault = faults_[i];
    if (!fault.acts_at(t_s)) continue;
    if (fault.kind == FaultKind::kSaturation) {
      reading.omega_radps =
          reading.omega_radps.cwiseMin(fault.gyro_range_radps).cwiseMax(-fault.gyro_range_radps);
      reading.f_mps2 = reading.f_mps2.cwiseMin(fault.accel_range_mps2).cwiseMax(-fault.accel_range_mps2);
    }
    if (fault.kind == FaultKind::kStuck) {
      if (!stuck_[i]) stuck_[i] = reading;
      if (fault.gyro) reading.omega_radps = stuck_[i]->omega_radps;
      if (fault.accel) reading.f_mps2 = stuck_[i]->f_mps2;
    }
  }
}

void SensorFaults::apply(double t_s, greis::Solution& solution) const {
  for (const Fault& fault : faults_) {
    if (!fault.acts_at(t_s)) continue;
    if (fault.kind == FaultKind::kSolution) solution.type = static_cast<std::uint8_t>(fault.solution_type);
    if (fault.kind == FaultKind::kRtkJump) {
      const GeodeticPosition there =
          displaced({solution.latitude_rad, solution.longitude_rad, solution.height_m}, fault.by_n_m);
      solution.latitude_rad = there.latitude_rad;
      solution.longitude_rad = there.longitude_rad;
      solution.height_m = there.height_m;
    }
  }
}

}  // namespace imusim
