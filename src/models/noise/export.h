#pragma once

/// Fitted models as another tool's configuration, in that tool's units and for that tool's equations.
///
/// - kalibr: imu.yaml, white noise and random walk of each triad
/// - openvins: kalibr_imu_chain.yaml; vins-fusion: acc_n, gyr_n, acc_w, gyr_w, of a sample; lio-sam:
///   params.yaml; gtsam: a piece of C++ that fills PreintegrationCombinedParams; each white noise and random
///   walk of each triad
/// - ros: ROS 2 parameters, covariances as in sensor_msgs/Imu; white noise and one Gauss-Markov bias a triad,
///   as IMU simulation plugins take them
/// - px4: EKF2 parameters, white noise and bias random walk of each triad
/// - kf-gins: kf-gins.yaml `imunoise`, white noise and Gauss-Markov bias of each axis, one correlation time
/// - state-space: JSON, the whole model of each axis as F, Q, H, R
///
/// Every number comes from the fitted model (felt_noise.h), none from a fit of a smaller one. A form that
/// holds fewer terms gets its own terms in their place: white noise with the density of all that is white at
/// a second, and a slow term that grows like the model's over the band in which that tool works, 1 s to 100 s
/// for those with a random walk, 1 s to 1000 s for ros, kf-gins and state-space. What the data only bound is
/// written as that bound. The file says all of that in its comments, and from which stretch of which regime
/// it comes.
///
/// With `conservative` the upper ends of the intervals take the places of the values: of a triad's axes the
/// highest.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "models/noise/fit.h"
#include "models/noise/quantities.h"

namespace imuscope::noise {

enum class ExportFormat : std::uint8_t {
  kKalibr,
  kOpenVins,
  kVinsFusion,
  kLioSam,
  kGtsam,
  kRos,
  kPx4,
  kKfGins,
  kStateSpace,
};

/// "kalibr", "openvins", "vins-fusion", "lio-sam", "gtsam", "ros", "px4", "kf-gins", "state-space". Errors:
/// kUsage, with the formats that exist.
Result<ExportFormat> parse_export_format(std::string_view text);

/// The fit of one axis to be written.
struct AxisFit {
  std::string axis;  ///< as it is named in the file: "gyro_x", "accel_z"
  SignalUnit unit = SignalUnit::kNone;
  FitResult fit;
  std::string source{};  ///< what the fit was made from, for people: "regime static, 812 s in 9 stretches"
};

struct ExportOptions {
  bool conservative = false;  ///< upper ends in place of the values
  bool force = false;         ///< write what would be refused, with the reason in the file
};

/// A conservative amplitude that exceeds the fitted one by more than this is refused: the record is too short
/// for the term.
inline constexpr double kConservativeMost = 2.0;

/// Errors: an axis without a unit (kUsage), no axes (kUsage), axes of different rates (kUsage). And kWork,
/// unless forced: a model that misses a level of the tool's band by more than it states (missed_level()), a
/// term that the data do not even bound, a conservative amplitude beyond kConservativeMost.
Result<std::string> export_models(const std::vector<AxisFit>& axes, ExportFormat format,
                                  const ExportOptions& options = {});

/// Variance of white noise per sample, as the covariances of sensor_msgs/Imu have it: what kRos writes for
/// one axis.
double white_variance_of_sample(const FitResult& fit);

}  // namespace imuscope::noise
