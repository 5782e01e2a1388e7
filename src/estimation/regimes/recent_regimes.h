#pragma once

/// Static and dynamic while a run goes on: by the rules of a finished run (motion_regimes.h), over its last
/// minute, and settled once the next seconds are known. A stop is found at its first moment, as afterwards,
/// and not when a slow mean has followed; what that costs is that regimes come kLookAhead_s late.

#include <optional>

#include "base/time.h"
#include "estimation/regimes/motion_levels.h"
#include "estimation/regimes/motion_regimes.h"

namespace imuscope {

/// Thread: one. Memory is bounded, whatever the length of the run.
class RecentRegimes {
 public:
  /// Within it a stop of a second, its guards and the level that its end is held against are complete.
  static constexpr double kLookAhead_s = 5.0;
  /// What a decision looks back on.
  static constexpr double kWindow_s = 60.0;
  /// Between decisions.
  static constexpr double kStep_s = 2.0;

  explicit RecentRegimes(const MotionLimits& limits) : limits_(limits) {}

  /// False where `time` lies so far from the newest sample that nothing holds between them.
  [[nodiscard]] bool follows(HostTime time) const;
  /// The reference, compensated with its biases, at one instant. Precondition: follows(time).
  void add(HostTime time, const Vector3& omega_ib_b_radps, const Vector3& f_b_mps2);
  /// A speed from before the window is no longer of use.
  void add_speed(HostTime time, double speed_mps, double sd_mps);
  /// Settles everything up to the newest sample: the run ends.
  void settle();

  /// Regimes before this time are settled; absent before the first are.
  [[nodiscard]] std::optional<HostTime> settled_until() const { return settled_until_; }
  /// Index as in static_and_dynamic(); absent where none holds. For times that became settled by the newest
  /// decision.
  [[nodiscard]] std::optional<std::size_t> at(HostTime time) const { return track_.at(time); }

 private:
  void decide(double look_ahead_s);

  MotionLimits limits_;
  MotionLevels levels_;
  RegimeTrack track_;
  std::optional<CellNoise> noise_;  ///< the least of all windows so far
  std::optional<HostTime> newest_;
  std::optional<HostTime> next_decision_;
  std::optional<HostTime> settled_until_;
};

}  // namespace imuscope
