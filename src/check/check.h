#pragma once

/// The look at the data before anything is estimated from them. Thresholds come from physics, data sheets and
/// statistics and stand with their source beside each check; healthy drives have no finding that harms.
/// Non-real-time; allocates.

#include <future>
#include <vector>

#include "check/finding.h"
#include "check/tracks.h"

namespace imuscope::check {

/// What is wrong, the greatest harm first. Corrects in `drive` what it has found, so that one mistake does
/// not hide another.
/// @param pairs  how each S-IMU is compared with the reference: by a thread of its own, or one after the other
[[nodiscard]] std::vector<Finding> look_at(Drive& drive, std::launch pairs = std::launch::deferred);

}  // namespace imuscope::check
