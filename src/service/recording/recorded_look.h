#pragma once

/// The look at a recording before anything is estimated from it (src/check).

#include <vector>

#include "base/result.h"
#include "check/finding.h"
#include "check/tracks.h"
#include "service/recording/replay.h"

namespace imuscope {

/// Decodes every device, an hour of it at most, and looks. A device that cannot be read has no finding:
/// whoever reads it next says why.
/// @param has_own_clock  per device: its times are not those of the run yet
/// @param longest_s  of each device, at most an hour; memory goes with it
[[nodiscard]] std::vector<check::Finding> look_at_recording(const Configuration& configuration,
                                                            const Recording& recording,
                                                            const std::vector<bool>& has_own_clock,
                                                            double longest_s = check::kLongest_s);

}  // namespace imuscope
