#pragma once

/// A replay on the bus: what the live run published, so that top, lcm-spy and any other listener can watch a
/// recording. Non-real-time.

#include <string>

#include "base/result.h"
#include "service/recording/replay.h"
#include "service/run/broadcast.h"

namespace imuscope {

class ReplayBroadcast {
 public:
  ReplayBroadcast(const Configuration& configuration, const Recording& recording, std::string version);

  /// Errors: those of LcmPublisher::open().
  [[nodiscard]] Result<void> open(const std::string& url);

  void on_error(const ErrorRecord& record) { broadcast_.on_error(record); }
  void on_refit(const Refit& refit);
  /// After the last of all.
  void finish() { broadcast_.finish(); }
  /// Publishes STATUS, too, once for every second of the recording.
  void on_snapshot(const Snapshot& snapshot);

 private:
  [[nodiscard]] status_t status(const Snapshot& snapshot) const;

  const Configuration& configuration_;
  const Recording& recording_;
  std::string version_;
  Broadcast broadcast_;
  std::int64_t refits_ = 0;
};

}  // namespace imuscope
