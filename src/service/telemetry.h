#pragma once

/// LCM messages straight from what the core and the modeller put out, in the units of the wire. Pure
/// functions; any thread of the soft world (they allocate). The publisher adds the sequence.

#include <imuscope/calibration_t.hpp>
#include <imuscope/dynamics_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/ins_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/pose_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <string>

#include "service/core.h"
#include "service/refit.h"

namespace imuscope {

/// Where UTC is on the host's time scale: from the R-IMU's tags, or from the PC's clock as long as there are
/// none.
struct UtcAnchor {
  HostTime host{};
  UtcTime utc{};
  [[nodiscard]] UtcTime at(HostTime time) const { return utc + (time - host); }
};

[[nodiscard]] navigation_t navigation_message(const Snapshot& snapshot, const UtcAnchor& anchor);
[[nodiscard]] odometry_t odometry_message(const Snapshot& snapshot, const UtcAnchor& anchor);
/// Where the motion has shown nothing of a state, its value is NaN.
/// @param study  index of the S-IMU that is called `name`
[[nodiscard]] calibration_t calibration_message(const Snapshot& snapshot, std::size_t study,
                                                const std::string& name, const UtcAnchor& anchor);
/// @param name  of the S-IMU
[[nodiscard]] error_t error_message(const ErrorRecord& record, const std::string& name,
                                    const UtcAnchor& anchor);

[[nodiscard]] wavelet_variance_t wavelet_variance_message(const Refit& refit, const UtcAnchor& anchor);
[[nodiscard]] noise_model_t noise_model_message(const Refit& refit, const UtcAnchor& anchor);
[[nodiscard]] dynamics_t dynamics_message(const Refit& refit, const UtcAnchor& anchor);

/// The navigation solution for those who listen to the widespread pose_t and ins_t, in their frames: body
/// forward-left-up, local east-north-up from `origin` on.
/// @param origin  the first snapshot with a navigation solution
[[nodiscard]] pose_t pose_message(const Snapshot& snapshot, const Snapshot& origin, const UtcAnchor& anchor);
[[nodiscard]] ins_t ins_message(const Snapshot& snapshot, const Snapshot& origin, const UtcAnchor& anchor);

}  // namespace imuscope
