#pragma once

/// Regimes found by the data, with the whole run in view: a change is placed where the motion began or ended,
/// not where it was noticed.
///
/// Static is where the vehicle stands (standstills.h), dynamic is where it moves. A guard on both sides of
/// each change belongs to neither: there a sample may be of the one or of the other, and a mixture of both is
/// what no noise model describes.

#include <string>
#include <vector>

#include "estimation/regimes/motion_levels.h"
#include "estimation/regimes/regime_track.h"
#include "estimation/regimes/standstills.h"

namespace imuscope {

inline constexpr const char* kStaticName = "static";
inline constexpr const char* kDynamicName = "dynamic";

/// "static" (index 0) and "dynamic" (index 1). A cell of which nothing is known goes on with the regime
/// before it. No regime holds in the guards and in stops shorter than the shortest that is wanted.
RegimeTrack static_and_dynamic(const MotionLevels& levels, const MotionLimits& limits);
/// The same of a part of a run.
/// @param noise  of the reference, as the whole run shows it
RegimeTrack static_and_dynamic(const MotionLevels& levels, const std::vector<MotionCell>& cells,
                               const MotionLimits& limits, const CellNoise& noise);

/// What the intensity of motion is measured by.
enum class Intensity : std::uint8_t { kRate, kVibration, kSpeed };

/// "static", then "intensity 1 of n" (least) to "intensity n of n": the dynamic stretches in blocks of
/// `block_s`, split at the quantiles of their rms rate, vibration or mean speed. After another block, a
/// block crosses an edge between two bins only where it lies clear of it by kIntensityEdge of the edge's
/// value (hysteresis). Blocks without a measure belong to no regime. Precondition: bins >= 2, block_s > 0.
inline constexpr double kIntensityEdge = 0.05;
RegimeTrack intensity_bins(const MotionLevels& levels, const RegimeTrack& motion, Intensity intensity,
                           int bins, double block_s);

}  // namespace imuscope
