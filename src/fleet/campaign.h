#pragma once

/// All tasks of a campaign on the cores of one machine. What has a result is passed over, so that a campaign
/// that was killed goes on where it was.

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"
#include "fleet/plan.h"
#include "fleet/study_task.h"

namespace imuscope::fleet {

/// How many of how many.
struct CampaignCount {
  std::size_t captures = 0;  ///< found
  std::size_t not_studied =
      0;  ///< that no mounting takes, that cannot be read, or of the same content as another
  std::size_t studied = 0;
  std::size_t refused = 0;
  std::size_t gave_up = 0;
  std::size_t not_yet = 0;
  std::size_t units = 0;
  std::size_t units_done = 0;
  [[nodiscard]] bool complete() const { return gave_up == 0 && not_yet == 0 && units_done == units; }
};

/// What the folder of results says.
CampaignCount count_results(const Plan& plan);

/// "198 of 200 captures studied, 1 refused, 1 given up; 40 of 40 units".
std::string words_of(const CampaignCount& count);

struct RunOptions {
  std::size_t jobs = 1;  ///< studies at once
  bool retry = false;    ///< what was given up is tried again
  std::filesystem::path program_file;
  /// Is told of each task that ended; one call at a time, from any thread.
  std::function<void(const StudyTask& task, const TaskOutcome& outcome, std::size_t ended, std::size_t of)>
      on_end;
};

/// Studies, then units. Errors: another run works in the folder (kUsage); the folder cannot be written
/// (kWork).
Result<void> run_campaign(const Plan& plan, const RunOptions& options, const std::atomic<bool>& stop);

}  // namespace imuscope::fleet
