#pragma once

/// From the configuration to the estimator's own terms.

#include "configuration/config.h"
#include "estimation/calibration/estimator_config.h"

namespace imuscope {

/// Studies come in the order of the configuration. What the configuration leaves out keeps the estimator's
/// default.
EstimatorConfig estimator_config(const Configuration& configuration);

/// A mounting that is known beforehand.
struct KnownMounting {
  Matrix3 C_b_s{};
  Vector3 r_bs_b_m{};
  double t_d_s = 0.0;
  Vector3 gyro_scale{};
  Vector3 accel_scale{};
};

/// The S-IMU with its mounting, time offset and scales known and its biases free, so that the reference is
/// evaluated at the right instant from the first sample on.
SImuConfig with_mounting(SImuConfig study, const KnownMounting& known);

}  // namespace imuscope
