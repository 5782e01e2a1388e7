#pragma once

/// The regimes of one run: found by its motion, its intensity or named by a person, and regimes.json.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "estimation/regimes/labels.h"
#include "estimation/regimes/motion_levels.h"
#include "service/pipeline/core.h"

namespace imuscope {

/// Gathers what regimes are found from while a recording is replayed.
class MotionWatch {
 public:
  void add(const SImuEpoch& epoch, const ReferenceBias& bias);
  void add(const Snapshot& snapshot);
  [[nodiscard]] const MotionLevels& levels() const noexcept { return levels_; }
  /// Speed known at one time at least.
  [[nodiscard]] bool has_speed() const noexcept { return has_speed_; }

 private:
  MotionLevels levels_;
  bool has_speed_ = false;
};

/// The regimes of one run, over its whole time.
struct RunRegimes {
  RegimeTrack motion;  ///< static and dynamic, whatever the regimes of the run are
  RegimeTrack chosen;  ///< what the noise models are fitted by
  RegimesBy by = RegimesBy::kMotion;
  std::vector<std::string> remarks;  ///< sentences for people
};

/// @param labels   of a file; empty: those of `moments`
/// @param origin   of time_s
/// Of more names than kMaxRegimes the first ones hold, and a remark tells of the others.
/// Errors (kUsage): labels asked for and none given.
Result<RunRegimes> find_regimes(const RegimeOptions& options, const MotionWatch& watch,
                                const std::vector<Label>& labels, const std::vector<MarkedMoment>& moments,
                                HostTime origin);

/// regimes.json without "left_out".
nlohmann::json regimes_json(const RunRegimes& regimes, HostTime origin);

}  // namespace imuscope
