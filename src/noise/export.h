#pragma once

/// Fitted models as another tool's configuration, in that tool's units and for that tool's equations.
///
/// - kalibr: imu.yaml, white noise and random walk of each triad
/// - ros: ROS 2 parameters, covariances as in sensor_msgs/Imu; white noise and one Gauss-Markov bias a triad,
///   as IMU simulation plugins take them
/// - px4: EKF2 parameters, white noise and bias random walk of each triad
/// - kf-gins: kf-gins.yaml `imunoise`, white noise and Gauss-Markov bias of each axis, one correlation time
/// - state-space: JSON, the whole model of each axis as F, Q, H, R
///
/// A form that holds fewer terms than the model gets the best model of that form for the same wavelet
/// variance; the file says so in its comments.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "noise/fit.h"
#include "noise/quantities.h"

namespace imuscope::noise {

enum class ExportFormat : std::uint8_t { kKalibr, kRos, kPx4, kKfGins, kStateSpace };

/// "kalibr", "ros", "px4", "kf-gins", "state-space". Errors: kUsage, with the formats that exist.
Result<ExportFormat> parse_export_format(std::string_view text);

/// The fit of one axis to be written.
struct AxisFit {
  std::string axis;  ///< as it is named in the file: "gyro_x", "accel_z"
  SignalUnit unit = SignalUnit::kNone;
  FitResult fit;
};

/// @param conservative  the over-bounding model of each axis (see conservative.h) in place of the fit
/// Errors: an axis without a unit (kUsage), no axes (kUsage), a fit whose wavelet variance is too short for
/// the form (kWork).
Result<std::string> export_models(const std::vector<AxisFit>& axes, ExportFormat format, bool conservative);

}  // namespace imuscope::noise
