#pragma once

/// Where a vehicle stands: stretches of rest of a second and more, with the whole run in view.
///
/// What a stop is. The force and the rate keep still: the means of cells scatter within half a second by less
/// than the limits for rest, and vibration stays below its own. A running engine is no motion: its lines lie
/// at 20 Hz and more, and the mean of a cell takes them out; what is left counts as vibration, and where a
/// speed says that the vehicle stands, it may shake six times as much: people get in, and after braking the
/// body swings on its springs.
///
/// What a creeping car is. A speed above the limit for motion is motion, however smooth the road. Where no
/// speed is known, a car that creeps without being felt (a level road, a constant speed) cannot be told from
/// one that stands, and counts as standing.
///
/// Between the limits for rest and those for motion the state stays (hysteresis). The edges are placed where
/// force and rate leave the level that they have inside the stop, which shows the release of a brake earlier
/// than the speed does. The noise of the reference itself is allowed for: the limits grow with the scatter
/// within cells, as the quietest tenth of them shows it.

#include <cstddef>
#include <vector>

#include "base/units.h"
#include "estimation/regimes/motion_levels.h"

namespace imuscope {

/// Limits of rest and motion for each measure; the spreads are those within half a second. Each limit for
/// rest lies below the one for motion.
struct MotionLimits {
  double rest_speed_mps = 0.15;
  double motion_speed_mps = 0.30;
  double rest_rate_spread_radps = 0.25 * kRadPerDeg;
  double motion_rate_spread_radps = 0.5 * kRadPerDeg;
  double rest_force_spread_mps2 = 0.08;
  double motion_force_spread_mps2 = 0.16;
  double rest_vibration_mps2 = 0.35;
  double motion_vibration_mps2 = 0.7;
  double shortest_static_s = 1.0;  ///< a shorter stop belongs neither to the drive nor to rest
  double guard_s = 0.3;            ///< on both sides of a change; belongs to neither
};

/// What the reference's white noise leaves in the means of cells: rms, all axes together.
struct CellNoise {
  double omega_radps = 0.0;
  double f_mps2 = 0.0;
};
CellNoise cell_noise(const std::vector<MotionCell>& cells);

/// Cells [first, last).
struct Standstill {
  std::size_t first;
  std::size_t last;
};

/// In order, without overlap. Inside a run none is shorter than 0.8 s: a shorter one is a moment in which a
/// moving vehicle happens to be still. A cell without samples goes on with what was before it.
/// @param noise  of the reference, as the quietest cells of the run show it
std::vector<Standstill> find_standstills(const std::vector<MotionCell>& cells, const MotionLimits& limits,
                                         const CellNoise& noise);

}  // namespace imuscope
