#pragma once

/// Mounting, clock and imperfections of one S-IMU from a whole drive at once, with the true motion unknown:
/// both IMUs measure it, so that noise of the reference is no error in the variables. The noise is learned
/// from the residuals. No filter, no GNSS, no noise figure, no tuning. EQUATIONS.md.
///
/// Non-real-time: allocates. Deterministic: the same records give the same bits. Reentrant.

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "base/result.h"
#include "estimation/batch/imu_record.h"
#include "estimation/batch/sensor_model.h"
#include "estimation/batch/stability.h"

namespace imuscope::batch {

struct BatchOptions {
  SensorClass sensor;
  double search_s = 3.0;  ///< time offsets from -search_s to +search_s are tried
  /// Angle random walk of the reference's gyros, rad/sqrt(s), where it is known; it says how straight its
  /// axes are. Otherwise its quietest readings tell, which are no less than it.
  std::optional<double> reference_gyro_white_radps_per_sqrt_hz{};
};

/// One band of frequency: noise that is left, and how far the pair is from a rigid body there.
struct BandReport {
  double from_hz = 0.0;
  double to_hz = 0.0;
  Eigen::Vector3d gyro_density;    ///< of the residuals, rad/s/sqrt(Hz), one-sided, per axis of s
  Eigen::Vector3d accel_density;   ///< m/s^2/sqrt(Hz)
  double gyro_deviation_sd = 0.0;  ///< of the transfer from R to S, relative; 0.01 is half a degree
  double accel_deviation_sd = 0.0;
};

/// What the variance of psi and r, each axis, consists of, as shares that add up to one.
struct LimitShares {
  Eigen::Matrix<double, 6, 1> sensor = Eigen::Matrix<double, 6, 1>::Zero();     ///< its imperfections
  Eigen::Matrix<double, 6, 1> reference = Eigen::Matrix<double, 6, 1>::Zero();  ///< its axes and scales
  /// Noise, and motion that did not show more.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> drive() const {
    return Eigen::Matrix<double, 6, 1>::Ones() - sensor - reference;
  }
};

/// Above this neither filter of the sensors nor body is to be trusted, and vibration rules: the estimate ends here.
inline constexpr double kTop_hz = 8.0;

/// The result. (psi, r) of `covariance` as everywhere: psi in b, C = C^ Exp(-psi).
struct BatchMounting {
  SensorState sensor;  ///< biases are those of the middle of the record
  Eigen::Matrix<double, kParameters, kParameters>
      covariance;  ///< of SensorState's parameters, published form
  double rate_correlation = 0.0;
  double middle_s = 0.0;  ///< instant that t_d belongs to, on the records' scale
  double used_s = 0.0;    ///< time inside windows
  std::size_t windows = 0;
  double degrees_of_freedom = 0.0;  ///< of the sd, for Student's t
  /// Largest sd of a component of (psi, r) by its scatter over time, divided by the sd that the noise alone
  /// would give.
  double inconsistency = 1.0;
  LimitShares limits;
  /// Whether the drive's parts agree. Where they do not, the sd reach to the mountings of both.
  Change change;
  double change_s = 0.0;  ///< its instant, on the records' scale
  /// What of the errors of (psi, r) every drive of this sensor on this reference has in common, F of the
  /// covariance F F' (B-23): places, axes and delays as they were believed to be before the drive, and the
  /// reference's own axes.
  Eigen::Matrix<double, 6, kParameters + kReferenceErrors> shared =
      Eigen::Matrix<double, 6, kParameters + kReferenceErrors>::Zero();
  bool one_chip = false;  ///< the accelerometers were found to be in one place
  int iterations = 0;
  bool settled = false;
  std::vector<BandReport> bands;

  [[nodiscard]] double sd(Parameter first, Eigen::Index component = 0) const;
};

/// @param reference  R-IMU, axes b
/// @param study      S-IMU, axes s
/// Errors: those of find_start(); a record without one window free of gaps.
[[nodiscard]] Result<BatchMounting> estimate_mounting(const ImuRecord& reference, const ImuRecord& study,
                                                      const BatchOptions& options = {});

}  // namespace imuscope::batch
