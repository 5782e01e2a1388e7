#pragma once

/// The live service: devices to estimates at 100 Hz, recorded, published, and written to a run folder.
///
/// Threads: I/O (FIFO), estimator (FIFO, below I/O), publisher (this one writes files and speaks LCM),
/// modeller (idle), recorder, and the caller's as supervisor (opens lines, logs). Where a privilege is
/// refused the service says so and runs on.

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "base/result.h"
#include "configuration/config.h"

namespace imuscope {

/// Names of the threads, as top, the kernel and STATUS show them.
inline constexpr const char* kIoThreadName = "imuscope-io";
inline constexpr const char* kEstimatorThreadName = "imuscope-est";
inline constexpr const char* kPublisherThreadName = "imuscope-pub";
inline constexpr const char* kModellerThreadName = "imuscope-model";

/// What the command line adds to the configuration of a live run; without `duration_s` it runs until it is
/// told to stop.
struct LiveOptions {
  std::filesystem::path out;     ///< run folder; the capture goes there too. Empty: a new one in `parent`
  std::filesystem::path parent;  ///< of a new folder (new_folder.h)
  std::string version;
  std::optional<double> duration_s;  ///< ends by itself after this time
  /// Called at the end with the run folder, when the recording and all results are in it and before run.mcap
  /// takes its documents up: makes those that come from above this room. Its error fails the run, and nothing
  /// is lost by it.
  std::function<Result<void>(const std::filesystem::path& folder)> add_documents;
};

/// What the outside asks for; a signal handler may set these.
struct LiveSignals {
  std::atomic<bool> stop{false};
  /// Read the configuration file again (reload.h); where the terminal is gone it is an end.
  std::atomic<bool> hang_up{false};
};
static_assert(std::atomic<bool>::is_always_lock_free);

/// Runs until signals.stop becomes true, its terminal is closed, or for options.duration_s. Ends cleanly:
/// what had arrived is estimated, recorded, published and written. Returns the run folder. Errors: a device
/// of the configuration has no line, the run folder already holds a recording, the run's name cannot name a
/// folder (kUsage); the run folder or the capture cannot be made, no device ever answered (kWork).
Result<std::filesystem::path> run_live(const Configuration& configuration, const LiveOptions& options,
                                       LiveSignals& signals);

}  // namespace imuscope
