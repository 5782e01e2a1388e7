#pragma once

/// The fifteen dynamics covariates of an error row, and what an error of the calibration would look like on
/// each axis. After Stebler et al. (2014), eq. (6) and Table I; equation numbers D-1 to D-3 in EQUATIONS.md.

#include <array>
#include <cstddef>
#include <string_view>

#include "estimation/error_process/error_row.h"

namespace imuscope {

/// Angular rate, angular acceleration, angular jerk, specific force and linear jerk, each on x, y, z of s.
enum class Covariate : std::uint8_t { kOmega, kOmegaDot, kOmegaDdot, kForce, kForceDot };
inline constexpr std::size_t kCovariateKinds = 5;
inline constexpr std::size_t kCovariates = 3 * kCovariateKinds;

/// "omega_x", "omega_dot_x", "omega_ddot_x", "f_x", "f_dot_x", ...
std::string_view covariate_name(std::size_t index) noexcept;
/// "rad/s", "rad/s^2", "rad/s^3", "m/s^2", "m/s^3".
std::string_view covariate_unit(std::size_t index) noexcept;

/// In the order of the kinds, x y z within; SI, s axes (D-1).
std::array<double, kCovariates> covariates(const ErrorRow& row) noexcept;

/// Columns that a small error of the calibration adds to axis `axis` of the error process (0-2 gyro x y z,
/// 3-5 accel x y z): boresight (two), scale, time offset, and for the accelerometers the lever arm (three,
/// x y z in s) (D-2, D-3).
inline constexpr std::size_t kGyroCalibrationColumns = 4;
inline constexpr std::size_t kAccelCalibrationColumns = 7;
std::size_t calibration_column_count(std::size_t axis) noexcept;
/// Writes them to `out` and leaves the rest of it untouched.
void calibration_columns(const ErrorRow& row, std::size_t axis,
                         std::array<double, kAccelCalibrationColumns>& out) noexcept;

/// True where the covariate is itself a calibration column of the axis: after projection nothing of it is
/// left.
bool is_calibration_column(std::size_t axis, std::size_t covariate) noexcept;

}  // namespace imuscope
