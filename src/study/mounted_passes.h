#pragma once

/// The two passes of a study that need the mountings: the filter that knows them, whose epochs are gathered, and the
/// smoothed drive. They run side by side, and where a long recording shows its mountings early, beside the rest of the
/// pass that calibrates. Non-real-time: a thread each, where more than one may be used.

#include <atomic>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "study/error_pass.h"
#include "study/smoothing.h"

namespace imuscope {

/// What is known of the mountings of a recording.
struct StudyMountings {
  std::vector<SImuOutput> of_drive;  ///< about which the drive is smoothed
  std::vector<SImuOutput> settled;   ///< with which the error process is made
  FormerMountings former;
};

class MountedPasses {
 public:
  /// What is passed over, and where files go. Outlives the passes.
  struct Drive {
    const Configuration& configuration;
    const EstimatorConfig& estimator;
    const Recording& recording;
    const OutputFolder& folder;
    std::filesystem::path path;  ///< of the folder
  };
  struct Passed {
    SmoothedTrack track;
    EpochGatherer epochs;
    Smoother history;  ///< of no further use; a large file ends with it
  };
  /// Called with the share of smoothing that is done.
  using Progress = std::function<void(double)>;

  /// Begins both. Errors (kWork): no file can be made in the folder.
  /// @param is_ahead  beside the pass that calibrates, whose way is the longest: what that leaves is enough
  static Result<std::unique_ptr<MountedPasses>> begin(const Drive& drive, StudyMountings mountings,
                                                      bool is_ahead);
  /// Gives up what is not done.
  ~MountedPasses();
  MountedPasses(const MountedPasses&) = delete;
  MountedPasses& operator=(const MountedPasses&) = delete;

  /// Whether passes with these mountings would be the same to the bit.
  [[nodiscard]] bool are_of(const StudyMountings& mountings) const;
  /// Waits for both. Once.
  /// @param progress  called now and then, by the thread that waits; empty: nobody asks
  [[nodiscard]] Result<Passed> result(const Progress& progress);

 private:
  MountedPasses(const Drive& drive, StudyMountings mountings, EpochGatherer epochs);
  [[nodiscard]] Result<SmoothedTrack> smooth();
  [[nodiscard]] Result<ReplayResult> gather();
  void may_gather();

  Drive drive_;
  StudyMountings mountings_;
  EpochGatherer epochs_;
  Smoother history_;
  Progress progress_;  ///< where the thread that waits is the one that works
  std::atomic<double> share_{0.0};
  std::atomic<bool> is_given_up_{false};
  std::atomic<bool> may_gather_{false};  ///< waits for it
  std::future<Result<ReplayResult>> gathered_;
  std::future<Result<SmoothedTrack>> smoothed_;
};

}  // namespace imuscope
