#pragma once

/// What the R-IMU's own axes may be off by beyond bias and noise. Whoever makes quieter gyros aligns and scales
/// their axes better, too, so that the white noise of the gyros says what to expect. EQUATIONS.md N-29. Core.

#include "base/units.h"

namespace imuscope {

/// Standard deviations. All zero: an ideal sensor.
struct ReferenceGrade {
  double scale_sd = 0.0;  ///< of each axis
  double lean_sd_rad =
      0.0;  ///< of each axis of a triad towards another, half of their departure from a right angle
  double triad_sd_rad = 0.0;  ///< accelerometer triad against gyro triad, about each axis
};

/// Navigation grade: what the best land vehicle references are, and none is taken to be better.
inline constexpr ReferenceGrade kNavigationGrade{3e-4, 1.5e-4, 3e-4};

/// Angle random walk of industrial MEMS, rad/sqrt(s): what a reference is taken for of which nothing is known.
inline constexpr double kIndustrialGyroWhite_radps_per_sqrt_hz = 0.3 * kRadPerDeg / 60.0;

/// N-29. @param gyro_white_radps_per_sqrt_hz  angle random walk, rad/sqrt(s), > 0
[[nodiscard]] ReferenceGrade reference_grade(double gyro_white_radps_per_sqrt_hz) noexcept;

}  // namespace imuscope
