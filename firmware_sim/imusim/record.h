#pragma once

/// Records a simulated run into files: for each device what the host would have read (NAME.bin) and when
/// (NAME.arrivals.csv), or what candump would have logged (NAME.log) of one on a CAN bus, all of it as one
/// capture (capture.lcm), the configuration that replays them, and the truth.

#include <filesystem>
#include <functional>

#include "firmware_sim/imusim/failure.h"
#include "firmware_sim/imusim/truth_files.h"
#include "firmware_sim/imusim/world.h"

namespace imusim {

struct RecordOptions {
  std::filesystem::path folder;
  bool true_errors = false;  ///< also errors_truth_NAME.csv of each S-IMU
  /// Told the share of the work that is done, 0 to 1, from the calling thread; may be empty.
  std::function<void(double)> on_progress;
  double truth_rows_hz = kTruthRows_hz;
};

/// What was written.
struct Recorded {
  std::string name;
  std::uint64_t bytes = 0;
  std::uint64_t reads = 0;
};

/// The same configuration gives the same files, byte by byte. A recording of imusim's own in the folder is
/// replaced; where a file that would be written is anybody else's, nothing is.
Outcome<std::vector<Recorded>> record(const Configuration& configuration, const RecordOptions& options);

}  // namespace imusim
