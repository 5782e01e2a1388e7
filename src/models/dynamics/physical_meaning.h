#pragma once

/// What a regression coefficient would mean if a physical fault of the mounting or of the sensor produced it.

#include <cstddef>
#include <string>

namespace imuscope {

/// The fault that a coefficient stands for, and the factor from the coefficient in SI to the unit in which
/// people speak of it.
struct PhysicalMeaning {
  std::string what;  ///< "misalignment", "scale error", "time offset", "g-sensitivity", "lever arm", ...
  std::string unit;  ///< "mdeg", "ppm", "us", "deg/s per g", "mm", ...
  double factor = 1.0;
};

/// @param axis       0-2 gyro x y z, 3-5 accel x y z
/// @param covariate  index of models/dynamics/covariates.h
PhysicalMeaning physical_meaning(std::size_t axis, std::size_t covariate);

/// Such as "misalignment of 12.3 mdeg".
std::string describe_coefficient(std::size_t axis, std::size_t covariate, double value);

}  // namespace imuscope
