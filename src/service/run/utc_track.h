#pragma once

/// The UTC of a run from its beginning to now: what the time scale said second by second, so that an instant
/// of long ago, or one that a person names in UTC, is found. Non-real-time: allocates.

#include <optional>
#include <vector>

#include "sample/utc_scale.h"

namespace imuscope {

/// Thread: one.
class UtcTrack {
 public:
  /// Takes the scale as it stands; times of its tags do not decrease. What a device tells replaces what the
  /// PC's clock said before, and what pulses do what a receiver's messages said.
  void add(const TimeScale& scale);

  /// An instant of the run; before the first tag and after the last along the line that goes through it.
  [[nodiscard]] UtcStamp at(HostTime time) const;
  /// The instant of a UTC; nothing where nobody told UTC. In a leap second the earlier one.
  [[nodiscard]] std::optional<HostTime> time_of(UtcTime utc) const;

 private:
  std::vector<TimeScale> scales_;  ///< one a second
};

}  // namespace imuscope
