#pragma once

/// A run folder and the recording that it was made of, as one MCAP file (logs/bag/bag_writer.h). Non-real-time.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"
#include "logs/mcap/compression.h"
#include "study/recording_of_run.h"

namespace imuscope {

/// Which run goes into which file, and how it is packed.
struct RunBagOptions {
  RunSource source;
  std::filesystem::path out;  ///< the file; replaces one of its name
  std::string version;        ///< of the program
  mcap::Compression compression = mcap::Compression::kZstd;
  bool with_errors = false;  ///< the error process, too: a message for each tenth of a second of each S-IMU
  std::function<void(double share)> progress;
};

/// What was written, for the person who asked.
struct RunBag {
  std::uint64_t messages = 0;
  std::uint64_t bytes = 0;
  bool times_are_utc = false;        ///< otherwise seconds since the run's first sample
  std::vector<std::string> remarks;  ///< what is missing of the recording, S-IMUs without a mounting
};

/// Errors: a folder that no run wrote; a recording that is no longer where it was; a disk that refuses the
/// file.
Result<RunBag> write_run_bag(const RunBagOptions& options);

}  // namespace imuscope
