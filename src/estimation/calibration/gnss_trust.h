#pragma once

/// How far a GNSS solution is believed. Core: no allocation, pure.

#include <Eigen/Core>

#include "estimation/calibration/estimator_config.h"

namespace imuscope {

/// sd of position (NED, m) and velocity (m/s) as the filter takes them: the receiver's own or the configured
/// ones, widened for a solution worse than fixed, never below the configured floor.
[[nodiscard]] Eigen::Vector3d trusted_position_sd(const GnssData& gnss, const GnssConfig& config) noexcept;
[[nodiscard]] Eigen::Vector3d trusted_velocity_sd(const GnssData& gnss, const GnssConfig& config) noexcept;

/// A position that is not fixed is wrong by much the same amount for half a minute and more (E-18). Its sd is
/// widened so that all of that time's solutions together tell what one of them is worth.
[[nodiscard]] double correlated_sd_factor(GnssSolution solution, double since_last_s) noexcept;

}  // namespace imuscope
