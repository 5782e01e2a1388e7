#pragma once

/// What a run says over LCM while it goes on, live and in a replay alike. Non-real-time.

#include <imuscope/status_t.hpp>
#include <optional>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "publish/lcm_publisher.h"
#include "service/pipeline/refit.h"
#include "service/run/telemetry.h"
#include "service/run/virtual_imu.h"

namespace imuscope {

/// Thread: one. Without a bus it says nothing and still knows the run's UTC.
/// What is said depends on what the core put out alone, so that a replay says the same.
class Broadcast {
 public:
  explicit Broadcast(const Configuration& configuration);

  /// @param bridge  pose_t and ins_t, too
  void open(LcmPublisher bus, bool bridge);
  /// Lets the bus that was given by open() send to `url`.
  [[nodiscard]] Result<void> connect(const std::string& url) { return bus_.value().connect(url); }
  void set_tap(LcmPublisher::Tap tap);

  void on_error(const ErrorRecord& record);
  void on_snapshot(const Snapshot& snapshot);
  void on_refit(const Refit& refit);
  void on_pc_clock(const PcClockLog::News& news, UtcTime utc);
  /// Counts its arrays, too.
  void on_status(status_t status);

  /// Says what is left of the error rows, at the end of the run.
  void finish();

  /// By the newest snapshot's time scale.
  [[nodiscard]] UtcStamp utc_at(HostTime time) const { return scale_.at(time); }

 private:
  void send(std::optional<error_t> rows);
  void send(std::optional<virtual_imu_t> rows);

  const Configuration& configuration_;
  std::vector<std::size_t> study_devices_;
  std::optional<LcmPublisher> bus_;
  bool bridge_ = false;
  std::optional<Snapshot> bridge_origin_;
  std::vector<ErrorBatch> errors_;  ///< per study
  std::optional<VirtualImu> virtual_imu_;
  TimeScale scale_;
};

}  // namespace imuscope
