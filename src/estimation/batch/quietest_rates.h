#pragma once

/// How quiet the reference's gyros are: its class, where nobody named it (B-21a).

#include "estimation/batch/normal_equations.h"

namespace imuscope::batch {

/// The angle random walk that the reference's gyros have at most, rad/sqrt(s): what they show in the band from 1 to
/// 10 Hz where they show least, in the quietest twentieth of the windows. Windows and band are chosen by the lower
/// half of its frequencies and read in the upper one: noise that was chosen for being small would be taken for less than it
/// is. Infinite where the windows are too short for such a band.
[[nodiscard]] double quietest_gyro_white_radps_per_sqrt_hz(const Problem& problem);

}  // namespace imuscope::batch
