#pragma once

/// Plays the devices of a configuration in real time on pseudo-terminals.

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "firmware_sim/imusim/failure.h"
#include "firmware_sim/imusim/world.h"

namespace imusim {

struct LiveOptions {
  double start_s = 0.0;                         ///< instant of the scenario to begin with
  std::optional<double> seconds;                ///< how long; to the end of the scenario where absent
  std::optional<std::filesystem::path> folder;  ///< where to write truth.json and truth.csv
  /// Told of each device once its port is open; may be empty.
  std::function<void(const std::string&)> on_line;
};

/// What one device sent.
struct LiveCounts {
  std::string name;
  std::uint64_t sent_bytes = 0;
  std::uint64_t dropped_bytes = 0;  ///< nobody had the port open, or did not read
  std::uint64_t received_bytes = 0;
};

/// Plays until the scenario or the given time is over, or `stop` is set.
Outcome<std::vector<LiveCounts>> play(const Configuration& configuration, const LiveOptions& options,
                                      const std::atomic<bool>& stop);

}  // namespace imusim
