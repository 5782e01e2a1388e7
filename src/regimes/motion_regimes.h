#pragma once

/// Regimes found by the data, with the whole run in view: a change is placed where the motion began or ended,
/// not where it was noticed.
///
/// Static and dynamic: motion begins where speed, the spread of rate or force, or vibration exceeds its limit
/// for motion, and reaches back to where it left its limit for rest; rest needs every level below its limit
/// for rest. Between the two limits the regime stays (hysteresis). A speed from GNSS or wheels has the last
/// word where there is one: with it a vehicle that stands may shake three times as much.

#include <string>

#include "base/units.h"
#include "regimes/motion_levels.h"
#include "regimes/regime_track.h"

namespace imuscope {

inline constexpr const char* kStaticName = "static";
inline constexpr const char* kDynamicName = "dynamic";

/// Limits of rest and motion for each measure; the spreads are those within a second. Each limit for rest
/// lies below the one for motion.
struct MotionLimits {
  double rest_speed_mps = 0.15;
  double motion_speed_mps = 0.30;
  double rest_rate_spread_radps = 0.25 * kRadPerDeg;
  double motion_rate_spread_radps = 0.5 * kRadPerDeg;
  double rest_force_spread_mps2 = 0.08;
  double motion_force_spread_mps2 = 0.16;
  double rest_vibration_mps2 = 0.35;
  double motion_vibration_mps2 = 0.7;
  double shortest_static_s = 10.0;  ///< a shorter standstill belongs to the drive around it
};

/// "static" (index 0) and "dynamic" (index 1) over the whole run. A cell of which nothing is known goes on
/// with the regime before it.
RegimeTrack static_and_dynamic(const MotionLevels& levels, const MotionLimits& limits);

/// What the intensity of motion is measured by.
enum class Intensity : std::uint8_t { kRate, kVibration, kSpeed };

/// "static", then "intensity 1 of n" (least) to "intensity n of n": the dynamic stretches in blocks of
/// `block_s`, split at the quantiles of their rms rate, vibration or mean speed. Behind another block, a
/// block crosses an edge between two bins only where it lies clear of it by kIntensityEdge of the edge's
/// value (hysteresis). Blocks without a measure belong to no regime. Precondition: bins >= 2, block_s > 0.
inline constexpr double kIntensityEdge = 0.05;
RegimeTrack intensity_bins(const MotionLevels& levels, const RegimeTrack& motion, Intensity intensity,
                           int bins, double block_s);

}  // namespace imuscope
