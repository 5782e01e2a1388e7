#pragma once

/// Turns reports into LCM messages: changes the units to those of the message, adds name and sequence. Pure
/// functions; any thread of the soft world (they allocate).

#include <cstdint>
#include <imuscope/calibration_t.hpp>
#include <imuscope/dynamics_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/ins_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/pose_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <string>

#include "publish/reports.h"

namespace imuscope {

/// utime of a message: whole microseconds, rounded down.
[[nodiscard]] std::int64_t to_utime(UtcTime utc) noexcept;

[[nodiscard]] status_t to_message(const StatusReport& report, std::int64_t sequence);
[[nodiscard]] navigation_t to_message(const NavigationReport& report, std::int64_t sequence);
[[nodiscard]] odometry_t to_message(const OdometryReport& report, std::int64_t sequence);
/// @param name of the S-IMU that report.device stands for
[[nodiscard]] calibration_t to_message(const CalibrationReport& report, const std::string& name,
                                       std::int64_t sequence);
/// @param name of the S-IMU that report.device stands for
[[nodiscard]] error_t to_message(const ErrorReport& report, const std::string& name, std::int64_t sequence);
[[nodiscard]] wavelet_variance_t to_message(const WaveletVarianceReport& report, std::int64_t sequence);
[[nodiscard]] noise_model_t to_message(const NoiseModelReport& report, std::int64_t sequence);
[[nodiscard]] dynamics_t to_message(const DynamicsReport& report, std::int64_t sequence);
[[nodiscard]] event_t to_message(const PersonEvent& event, std::int64_t sequence);
/// The same report in the two layouts of the bridge.
[[nodiscard]] pose_t to_pose(const BridgeReport& report);
[[nodiscard]] ins_t to_ins(const BridgeReport& report);

}  // namespace imuscope
