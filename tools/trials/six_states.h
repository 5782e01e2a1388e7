#pragma once

/// What the paper's six states (boresight, lever arm) make of sensors with biases, in closed form: the error
/// of weighted least squares whose model leaves the biases out. No filter and no random number is involved.

#include <Eigen/Core>

#include "estimation/calibration/estimator_config.h"
#include "firmware_sim/motion/motion.h"

namespace standard_drive {

/// Standard deviations over all sensors of a class, of one drive.
struct SixStateErrors {
  Eigen::Vector3d psi_rad;
  Eigen::Vector3d r_m;
};

/// With z = H x + b + white noise and b left out, x^ - x = N^-1 H' R^-1 (b + noise), N = H' R^-1 H. b is a
/// constant of the turn-on's sd and a Gauss-Markov process, each axis alike, so that the mounting drops out.
[[nodiscard]] SixStateErrors six_state_errors(const imusim::Motion& motion, double duration_s,
                                              const Eigen::Vector3d& r_bs_b_m,
                                              const imuscope::SImuConfig& study);

}  // namespace standard_drive
