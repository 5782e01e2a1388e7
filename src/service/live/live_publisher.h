#pragma once

/// The publisher's thread: takes what the core and the I/O thread put out, publishes it over LCM, writes the
/// run folder and feeds the modeller. Non-real-time.

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "capture/recorder.h"
#include "configuration/config.h"
#include "publish/lcm_listener.h"
#include "publish/message_values.h"
#include "service/doors/status_board.h"
#include "service/lines/can_watch.h"
#include "service/lines/io_thread.h"
#include "service/live/event_gate.h"
#include "service/live/live.h"
#include "service/live/live_bag.h"
#include "service/live/minute_line.h"
#include "service/live/pulse.h"
#include "service/live/reload.h"
#include "service/pipeline/core_thread.h"
#include "service/pipeline/noise_feedback.h"
#include "service/pipeline/observability.h"
#include "service/run/alarms.h"
#include "service/run/broadcast.h"
#include "service/run/health.h"
#include "service/run/live_smoothing.h"
#include "service/run/modeller.h"
#include "service/run/run_folder.h"

namespace imuscope {

class LivePublisher {
 public:
  /// Makes the run folder and opens the bus. Without a multicast route it works on without publishing, says
  /// so, and takes the bus when there is one.
  static Result<std::unique_ptr<LivePublisher>> create(const Configuration& configuration,
                                                       noise::ModelSpec spec, const LiveOptions& options,
                                                       IoThread& io, CoreThread& estimator);
  ~LivePublisher();
  LivePublisher(const LivePublisher&) = delete;
  LivePublisher& operator=(const LivePublisher&) = delete;

  /// Writes smoothed_navigation.csv and smoothed_NAME.csv from `history`, seconds late. Call before start().
  [[nodiscard]] Result<void> smooth(LiveHistory& history, const EstimatorConfig& estimator);
  /// Everything that is published, heard and applied goes into the capture, too. Call before start().
  void set_recorder(Recorder& recorder);
  /// Everything that is published, and the estimates, go into the run's MCAP file, too. Call before
  /// set_recorder(); the file must outlive the thread.
  void set_bag(LiveBag& bag) { bag_ = &bag; }
  /// Of the run.
  [[nodiscard]] const OutputFolder& folder() const { return folder_->folder(); }
  /// What the system refused at start; repeated in every status message.
  void set_refusals(const std::vector<Error>& refusals);
  /// What the decoders need of their CAN buses, per device; for those watched. Call before start().
  void watch_can(const std::vector<std::vector<CanId>>& ids);
  /// Why a device's line does not open; empty once it is open. Any non-real-time thread.
  void set_line_problem(DeviceIndex device, const std::string& problem);
  void start();
  /// Takes over what changed, at the thread's next turn. Any thread.
  void reconfigure(const Tunables& tunables);
  /// Of every thread of the run but the caller's. Call after set_recorder().
  [[nodiscard]] std::vector<Pulse> pulses() const;
  /// The newest status, for the doors. Lives as long as the publisher.
  [[nodiscard]] const StatusBoard& board() const noexcept { return board_; }
  /// The last overall state and its reason, for the log and systemd. Any thread.
  [[nodiscard]] Health health() const;
  /// Publishes and writes what is left, closes the files. Call after the core's thread has ended.
  [[nodiscard]] Result<void> finish(std::int64_t last_tick);

 private:
  LivePublisher(const Configuration& configuration, noise::ModelSpec spec, const LiveOptions& options,
                IoThread& io, CoreThread& estimator);
  void loop();
  void drain();
  void open_bus();
  void watch_bus();
  void tell_bus_problem(const std::string& problem);
  Result<void> listen_for_events();
  void take_over_tunables();
  void on_person_event(const std::string& channel, std::span<const std::uint8_t> bytes);
  void on_noise_applied(const AppliedNoise& applied);
  void on_error(const ErrorRecord& record);
  void on_snapshot(const Snapshot& snapshot);
  void on_refit(const Refit& refit);
  void watch_devices(HostTime now);
  void watch_pc_clock(HostTime now);
  void publish_status(HostTime now);
  [[nodiscard]] const SImuOutput* study_of(std::size_t index) const;
  [[nodiscard]] std::string problem_of(std::size_t device, HostTime now);
  [[nodiscard]] UtcTime utc_at(HostTime time) const;
  [[nodiscard]] status_t status(HostTime now);
  void fill_device(std::size_t index, device_status_t& device, HostTime now) const;
  void add_threads(status_t& status, HostTime now);
  void add_rings(status_t& status);
  void add_alarms(status_t& status, HostTime now);

  const Configuration& configuration_;
  LiveOptions options_;
  IoThread& io_;
  CoreThread& estimator_;
  Recorder* recorder_ = nullptr;
  LiveBag* bag_ = nullptr;
  std::vector<std::size_t> study_devices_;
  EstimatorConfig estimator_config_;
  Tunables tunables_;
  Broadcast broadcast_;
  std::optional<LcmListener> ear_;
  EventGate event_gate_;
  bool connected_ = false;      ///< messages are sent
  std::uint32_t heard_on_ = 0;  ///< this PC's address where ear_ listens
  HostTime bus_looked_{};
  std::string bus_problem_;
  std::string last_event_;
  std::unique_ptr<RunFolder> folder_;
  Modeller modeller_;
  std::optional<LiveSmoothing> smoothing_;
  std::vector<NoiseFeedback> feedback_;  ///< per study
  std::int64_t applied_ = 0;
  std::optional<Snapshot> last_;
  MinuteLine minute_line_{configuration_};

  struct DeviceWatch {
    SessionState session = SessionState::kConnecting;
    std::string problem;
    std::uint64_t epochs = 0;  ///< at the last status
    double rate_hz = 0.0;
  };
  std::vector<DeviceWatch> watches_;
  std::vector<LineStatus> lines_;
  std::vector<std::optional<CanWatch>> can_watches_;  ///< one a device
  std::mutex line_problems_mutex_;
  std::vector<std::string> line_problems_;
  PcClockLog pc_clock_;
  ClockKeeperInquiry clock_keepers_;
  std::vector<CalibrationStatus> study_states_;
  std::vector<ObservabilityWatch> observability_;
  std::int64_t refits_ = 0;
  NewestModels models_;
  double refit_duration_s_ = kUnknown;
  std::optional<UtcTime> refit_utc_;
  ThreadWatch threads_;
  PeriodicStatistics beat_;
  GrowingCounts growing_;
  AlarmBook alarms_;
  StatusBoard board_;
  HostTime started_;
  HostTime last_status_{};
  mutable std::mutex shared_mutex_;  ///< what other non-real-time threads ask for or hand in
  std::vector<Error> refusals_;
  std::optional<Tunables> new_tunables_;
  Health health_{"starting", "the threads start"};
  Heartbeat heartbeat_{host_now()};
  std::atomic<bool> running_{false};
  std::thread thread_;
};

}  // namespace imuscope
