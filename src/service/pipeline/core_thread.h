#pragma once

/// The estimator's thread: one core tick every 10 ms on absolute deadlines; what comes out goes into rings.

#include <atomic>
#include <memory>
#include <thread>

#include "base/limits.h"
#include "capture/records.h"
#include "rt/heartbeat.h"
#include "rt/host_clock.h"
#include "rt/latest_value.h"
#include "rt/periodic.h"
#include "rt/thread_setup.h"
#include "service/pipeline/core.h"

namespace imuscope {

/// Rings from the core to the publisher; how long it may stand still: base/limits.h.
struct CoreRings {
  SpscRing<ErrorRecord, kErrorRingCapacity> errors;
  SpscRing<EstimatorEvent, kEventRingCapacity> events;
  SpscRing<Snapshot, kSnapshotRingCapacity> snapshots;
  SpscRing<AppliedNoise, kAppliedNoiseRingCapacity> noises;
  ExceptionRing exceptions;  ///< to the recorder
};

/// Pushes into the rings; what they refuse is counted by them.
class RingCoreSink final : public CoreSink {
 public:
  explicit RingCoreSink(CoreRings& rings) : rings_(rings) {}
  void on_error(const ErrorRecord& record) noexcept override { (void)rings_.errors.try_push(record); }
  void on_event(const EstimatorEvent& event) noexcept override { (void)rings_.events.try_push(event); }
  void on_snapshot(const Snapshot& snapshot) noexcept override { (void)rings_.snapshots.try_push(snapshot); }
  void on_late_sample(const LateSample& late) noexcept override {
    (void)rings_.exceptions.try_push(
        {ExceptionKind::kLateSample, late.device, static_cast<std::int64_t>(late.sequence), late.tick, 1});
  }
  void on_noise_applied(const AppliedNoise& applied) noexcept override {
    (void)rings_.noises.try_push(applied);
  }

 private:
  CoreRings& rings_;
};

class CoreThread {
 public:
  /// The thread wakes this long after a cut: the I/O thread needs a moment from the stamp of a read to the
  /// push of its samples, and a sample that is pushed too late for its tick is an exception to be recorded.
  static constexpr Duration kGuard = std::chrono::microseconds(30);

  CoreThread(Core& core, HostTime t0);
  ~CoreThread();
  CoreThread(const CoreThread&) = delete;
  CoreThread& operator=(const CoreThread&) = delete;

  /// @param[out] refusals  what the system refused of the plan, appended
  void start(const ThreadPlan& plan, std::vector<Error>& refusals);
  /// Ticks on until the tick with index `last` is done, then ends. Call after the I/O thread has ended.
  void finish(std::int64_t last);

  [[nodiscard]] CoreRings& rings() { return *rings_; }
  /// Hands the noise model of a refit to the estimator. Thread: the publisher's.
  void offer_noise(std::size_t study, const NewNoise& model) noexcept { core_.offer_noise(study, model); }
  /// Newest statistics of the beat. One reader: the publisher.
  [[nodiscard]] PeriodicStatistics statistics();
  [[nodiscard]] const Heartbeat& heartbeat() const { return heartbeat_; }
  /// Index of the last tick done; -1 before the first.
  [[nodiscard]] std::int64_t last_tick() const { return last_tick_.load(std::memory_order_acquire); }

 private:
  void loop();

  Core& core_;
  HostTime t0_;
  std::unique_ptr<CoreRings> rings_;
  LatestValue<PeriodicStatistics> statistics_;
  Heartbeat heartbeat_{host_now()};
  std::atomic<std::int64_t> last_tick_{-1};
  std::atomic<std::int64_t> end_after_{std::numeric_limits<std::int64_t>::max()};
  std::thread thread_;
};

}  // namespace imuscope
