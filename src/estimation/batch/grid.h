#pragma once

/// An IMU's samples, low-passed and evaluated at the instants of a uniform grid. Both IMUs pass the same
/// filter of linear phase, so that what one shows of the other's motion is not changed by it (B-1, B-2).

#include <Eigen/Core>
#include <vector>

#include "estimation/batch/imu_record.h"

namespace imuscope::batch {

/// Instants per second of the grid. Its Nyquist frequency lies beyond where the low-pass has come to nothing.
inline constexpr double kGridRate_hz = 50.0;
/// The low-pass: half its amplitude at this frequency.
inline constexpr double kLowPass_hz = 10.0;
/// Half the length of its kernel.
inline constexpr double kKernelHalf_s = 0.25;

/// One row per instant: angular rate and specific force, the angular rate's derivative, and products.
struct Grid {
  Eigen::Matrix<double, Eigen::Dynamic, 6> motion;     ///< omega, rad/s; f, m/s^2
  Eigen::Matrix<double, Eigen::Dynamic, 3> omega_dot;  ///< rad/s^2; only where it was asked for
  /// Low-passed products of the samples' rates: xx, yy, zz, xy, xz, yz; only where they were asked for. What shakes faster
  /// than the low-pass lets through has products that are slow.
  Eigen::Matrix<double, Eigen::Dynamic, 6> products;
  std::vector<char> valid;  ///< 0 where samples are missing around the instant
};

/// xx, yy, zz, xy, xz, yz.
[[nodiscard]] Eigen::Matrix<double, 1, 6> products_of(const Eigen::RowVector3d& omega_radps);

/// @param record     more than two samples
/// @param instants   times on the record's own scale, increasing
/// @param as_reference  whether the derivative and the products are wanted
[[nodiscard]] Grid make_grid(const ImuRecord& record, const std::vector<double>& instants, bool as_reference);

/// Median spacing of the samples, s. Precondition: two samples at least.
[[nodiscard]] double sample_period_s(const ImuRecord& record);

}  // namespace imuscope::batch
