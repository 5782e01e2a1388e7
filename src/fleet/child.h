#pragma once

/// A program that is run to its end, with limits, and what became of it.

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"

namespace imuscope::fleet {

/// How a program ended.
struct ChildEnd {
  int exit_code = -1;  ///< -1 where a signal ended it
  int signal = 0;
  bool timed_out = false;
  bool stopped = false;  ///< by `stop`
  double wall_s = 0.0;
  double cpu_s = 0.0;
  double peak_mb = 0.0;
};

struct ChildLimits {
  double memory_mb = 0.0;  ///< of its data; 0: none
  double timeout_s = 0.0;  ///< 0: none
};

/// Runs the program; what it prints goes to the new file `log` of `folder`. It dies with the thread that
/// started it, so that nothing is left of a campaign that was killed.
/// @param words  program and arguments
/// @param stop   ends the program when it becomes true
/// Errors: kWork, the program cannot be started.
Result<ChildEnd> run_child(const std::vector<std::string>& words, const OutputFolder& folder,
                           const std::string& log, const ChildLimits& limits, const std::atomic<bool>& stop);

}  // namespace imuscope::fleet
