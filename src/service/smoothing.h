#pragma once

/// The smoothed drive of a study: a pass of its own over the recording, linearised about the mounting that
/// was found, whose history is smoothed. Soft world: allocates, writes files.

#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "base/result.h"
#include "calibration/smoother.h"
#include "error_process/error_row.h"
#include "service/replay.h"
#include "service/run_folder.h"

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

/// Replays `recording` with every state free, the mounting's first values being those of `finals`, so that
/// the whole drive is covered from its first sample on, and smooths what the filter saw.
Result<SmoothedTrack> smooth_drive(const Configuration& configuration, const EstimatorConfig& estimator,
                                   const Recording& recording, const std::vector<StudyOutput>& finals,
                                   const RecordStorage& storage, const std::function<void(double)>& progress);

/// Writes smoothed_navigation.csv (columns of navigation.csv; where there was navigation) and, per S-IMU,
/// smoothed_NAME.csv (columns of calibration_NAME.csv): biases smoothed, the constants of the mounting at
/// their end values, with the end value's sd.
Result<void> write_smoothed(const SmoothedTrack& track, const Snapshot& last,
                            const std::vector<StudyFileInfo>& infos, const std::filesystem::path& folder);

/// The paper's final value of each S-IMU: mean over the drive of the smoothed values, weighted by their
/// inverse variances; calibration.json's "weighted_mean". Null for an S-IMU that was never calibrated.
Result<std::vector<nlohmann::json>> weighted_means(const SmoothedTrack& track,
                                                   const std::vector<StudyOutput>& finals);

}  // namespace imuscope
