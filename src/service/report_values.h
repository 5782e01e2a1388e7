#pragma once

/// From the core's outputs to what is published. Conversions alone; no state.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "noise/fit.h"
#include "noise/wavelet_variance.h"
#include "publish/reports.h"
#include "service/core.h"

namespace imuscope {

/// A difference whose corrected p is below counts as shown.
inline constexpr double kSignificance = 0.05;

/// Where UTC is on the host's time scale: from the R-IMU's tags, or from the PC's clock as long as there are
/// none.
struct UtcAnchor {
  HostTime host{};
  UtcTime utc{};
  [[nodiscard]] UtcTime at(HostTime time) const { return utc + (time - host); }
};

NavigationReport navigation_report(const Snapshot& snapshot, const UtcAnchor& anchor);
OdometryReport odometry_report(const Snapshot& snapshot, const UtcAnchor& anchor);
CalibrationReport calibration_report(const Snapshot& snapshot, std::size_t study, DeviceIndex device,
                                     const UtcAnchor& anchor);
/// For the bridge to pose_t and ins_t.
/// @param origin  the first snapshot with a navigation solution: origin of the local frame
BridgeReport bridge_report(const Snapshot& snapshot, const Snapshot& origin, const UtcAnchor& anchor);
ErrorReport error_report(const ErrorRecord& record, DeviceIndex device, const UtcAnchor& anchor);

/// @param axis  0 to 5, see noise_series.h
AxisWaveletVariance axis_wavelet_variance(const noise::WaveletVariance& wv, std::size_t axis, Regime regime,
                                          double rate_hz);
/// One entry of models.json.
nlohmann::json model_json(const noise::FitResult& fit, const std::string& name, std::size_t axis,
                          const std::string& regime);
AxisNoiseModel axis_noise_model(const noise::FitResult& fit, std::size_t axis, Regime regime);

}  // namespace imuscope
