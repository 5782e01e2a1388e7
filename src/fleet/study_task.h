#pragma once

/// One study of a campaign: a process of its own, tried again where it died, and its result as one document.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>

#include "base/result.h"
#include "fleet/plan.h"

namespace imuscope::fleet {

/// What the folder of results says of a task.
enum class TaskState : std::uint8_t {
  kNotYet,
  kStudied,
  kRefused,      ///< the capture or its configuration does not allow a study; trying again changes nothing
  kGaveUp,       ///< it died as often as it may
  kInterrupted,  ///< of this call alone
};

/// "not yet", "studied", "refused", "gave up", "interrupted".
const char* key_of(TaskState state) noexcept;

/// What a call of a task came to.
struct TaskOutcome {
  TaskState state = TaskState::kNotYet;
  bool was_there = false;  ///< nothing was left to do
  std::string reason;
};

/// Of the result under `key`, if it stands there.
TaskOutcome study_state(const std::filesystem::path& out, const std::string& key);

/// Does the task, unless its result stands there. However often and wherever it is called: the same result.
/// @param program       program_identity() of this program
/// @param program_file  whose command `process` makes the study
/// Errors: kWork, the campaign's folder cannot be written; kUsage, the key is of another capture,
/// configuration or program.
Result<TaskOutcome> do_study(const StudyTask& task, const std::string& program,
                             const std::filesystem::path& program_file, const std::atomic<bool>& stop);

/// Takes a result away that was given up, so that the task is tried again.
Result<void> forget_given_up(const std::filesystem::path& out, const std::string& key);

}  // namespace imuscope::fleet
