#pragma once

/// Which runs of a folder may go when it grows, and their removal. Non-real-time.
///
/// A folder is a run that may go only where all of this holds: it lies in the folder of [record] itself and
/// is no link; nothing is in it but regular files that a live run writes, a capture with the header of a run
/// among them; nobody marked it (kKeptMark); nobody records into it (RunLock). Whatever else lies there is
/// passed over: a folder into which somebody put something of his own is his.

#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "base/time.h"
#include "configuration/config.h"

namespace imuscope {

/// A file in the folder of a run that keeps it.
inline constexpr const char* kKeptMark = "kept";
/// As top and the kernel show the thread that removes.
inline constexpr const char* kRetentionThreadName = "imuscope-retain";

/// Marks a run, or takes the mark away. kUsage where the folder is no run.
[[nodiscard]] Result<void> set_kept(const std::filesystem::path& run, bool kept);

/// Says that a run is being recorded, as long as it lives, also to other processes. Where the file system has
/// no locks it says nothing.
class RunLock {
 public:
  explicit RunLock(const std::filesystem::path& run);

 private:
  Descriptor folder_;
};

/// One run that may go.
struct RemovableRun {
  std::string name;  ///< of its folder
  UtcTime ended;     ///< when a file of it was written last, by the PC's clock
  std::uint64_t bytes = 0;
};

/// Those in `folder`, the oldest first.
[[nodiscard]] std::vector<RemovableRun> removable_runs(const std::filesystem::path& folder);

struct Removal {
  RemovableRun run;
  std::string reason;
};

/// What has to go by the limits. Pure function.
/// @param runs        the oldest first
/// @param now         by the PC's clock. Where it is before the end of a run the clock was not set, and no
/// age is believed
/// @param all_bytes   of all runs, those that may not go as well
/// @param free_bytes  of the disk
[[nodiscard]] std::vector<Removal> runs_to_remove(const std::vector<RemovableRun>& runs,
                                                  const RecordOptions& limits, UtcTime now,
                                                  std::uint64_t all_bytes, std::uint64_t free_bytes);

/// Removes them; tells each in the log. Looks once more whether it may.
void apply_retention(const std::filesystem::path& folder, const RecordOptions& limits);

/// Does that at the start and each minute, at idle priority, until it is destroyed. Without limits it does
/// nothing.
class Retention {
 public:
  Retention(std::filesystem::path folder, const RecordOptions& limits);
  ~Retention();
  Retention(const Retention&) = delete;
  Retention& operator=(const Retention&) = delete;

 private:
  std::mutex mutex_;
  std::condition_variable over_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace imuscope
