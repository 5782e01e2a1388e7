#pragma once

/// The live service: devices to estimates at 100 Hz, recorded, published, and written to a run folder.
///
/// Threads: I/O (FIFO), estimator (FIFO, below I/O), publisher (this one writes files and speaks LCM),
/// modeller (idle), recorder, and the caller's as supervisor (opens lines, logs). Where a privilege is
/// refused the service says so and runs on.

#include <atomic>
#include <filesystem>
#include <optional>
#include <string>

#include "base/result.h"
#include "service/config.h"

namespace imuscope {

struct LiveOptions {
  std::filesystem::path out;  ///< run folder; the capture goes there too
  std::string version;
  std::optional<double> duration_s;  ///< ends by itself after this time
};

/// Runs until `stop` becomes true, or for options.duration_s. Ends cleanly: what had arrived is estimated,
/// recorded, published and written.
/// Errors: no device of the configuration has a line (kUsage); the run folder or the capture cannot be made,
/// no device ever answered (kWork).
Result<void> run_live(const Configuration& configuration, const LiveOptions& options,
                      const std::atomic<bool>& stop);

}  // namespace imuscope
