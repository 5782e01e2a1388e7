#pragma once

/// What the configuration says of an IMU's white noise, as a bag has it.

#include "configuration/config.h"
#include "logs/bag/bag_writer.h"

namespace imuscope {

/// Zero where the configuration says nothing.
[[nodiscard]] inline bag::WhiteVariance configured_variance(const ImuNoiseConfig& noise) {
  bag::WhiteVariance variance;
  const double gyro = noise.gyro_white_sd_radps.value_or(0.0);
  const double accel = noise.accel_white_sd_mps2.value_or(0.0);
  variance.gyro.fill(gyro * gyro);
  variance.accel.fill(accel * accel);
  return variance;
}

}  // namespace imuscope
