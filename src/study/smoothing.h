#pragma once

/// The smoothed drive of a study: a pass of its own over the recording, linearised about the mounting that
/// was found, whose history is smoothed. Non-real-time: allocates, writes files.

#include <atomic>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "estimation/calibration/smoother.h"
#include "estimation/error_process/error_row.h"
#include "service/recording/replay.h"
#include "service/run/run_folder.h"

namespace imuscope {

/// R biases over a whole drive, linear between smoothed epochs and constant beyond the first and the last.
class ReferenceBiasTrack {
 public:
  /// Fails where the disk does.
  static Result<ReferenceBiasTrack> of(const SmoothedTrack& track);

  [[nodiscard]] bool empty() const noexcept { return times_.empty(); }
  /// Precondition: !empty().
  [[nodiscard]] ReferenceBias at(HostTime time) const noexcept;

 private:
  std::vector<HostTime> times_;
  std::vector<ReferenceBias> biases_;
};

/// A mounting that an S-IMU had before it was found to sit differently.
struct FormerMounting {
  HostTime until;       ///< when the change was noticed
  SImuOutput estimate;  ///< the last one of that mounting
};
/// Per S-IMU, in order of time; none where it stayed where it was.
using FormerMountings = std::vector<std::vector<FormerMounting>>;

/// Whether an S-IMU has the mounting of the drive's end at a time.
[[nodiscard]] bool is_final_mounting(const std::vector<FormerMounting>& former, HostTime time) noexcept;

/// Replays `recording` with every state free, the mounting's first values being those in force at its start,
/// so that the whole drive is covered from its first sample on, and smooths what the filter saw.
/// @param history      new; what it keeps is of no use after
/// @param is_given_up  as ReplayOptions has it
Result<SmoothedTrack> smooth_drive(const Configuration& configuration, const EstimatorConfig& estimator,
                                   const Recording& recording, const std::vector<SImuOutput>& finals,
                                   const FormerMountings& former, Smoother& history,
                                   const std::function<void(double)>& progress,
                                   const std::atomic<bool>* is_given_up);

/// Writes smoothed_navigation.csv (columns of navigation.csv; where there was navigation) and, per S-IMU,
/// smoothed_NAME.csv (columns of calibration_NAME.csv): biases smoothed, the constants of the mounting at
/// their end values, with the end value's sd; while a former mounting was in force, its own.
/// @param utc  of the run
Result<void> write_smoothed(const SmoothedTrack& track, const Snapshot& last, const UtcTrack& utc,
                            const FormerMountings& former, const std::vector<SImuFileInfo>& infos,
                            const OutputFolder& folder);

/// The paper's final value of each S-IMU: mean over the drive of the smoothed values, weighted by their
/// inverse variances, of the final mounting; calibration.json's "weighted_mean". Null for an S-IMU that was
/// never calibrated.
Result<std::vector<nlohmann::json>> weighted_means(const SmoothedTrack& track,
                                                   const std::vector<SImuOutput>& finals,
                                                   const FormerMountings& former);

}  // namespace imuscope
