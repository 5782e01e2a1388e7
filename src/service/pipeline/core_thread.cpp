#include "service/pipeline/core_thread.h"

namespace imuscope {

CoreThread::CoreThread(Core& core, HostTime t0)
    : core_(core), t0_(t0), rings_(std::make_unique<CoreRings>()) {}

CoreThread::~CoreThread() {
  end_after_.store(-1, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

void CoreThread::start(const ThreadPlan& plan, std::vector<Error>& refusals) {
  thread_ = start_core_thread(plan, refusals, [this] { loop(); });
}

void CoreThread::finish(std::int64_t last) {
  end_after_.store(last, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

PeriodicStatistics CoreThread::statistics() {
  (void)statistics_.take();
  return statistics_.value();
}

void CoreThread::loop() {
  RingCoreSink sink(*rings_);
  PeriodicLoop beat(t0_ + kGuard, kTickPeriod);
  // What came at last of a stall is caught up with, whenever the end was asked for.
  while (last_tick_.load(std::memory_order_relaxed) < end_after_.load(std::memory_order_acquire) ||
         (core_.catches_up() && end_after_.load(std::memory_order_relaxed) >= 0)) {
    const Tick tick = beat.wait();
    if (tick.skipped > 0) {
      (void)rings_->exceptions.try_push({ExceptionKind::kSkippedTicks, 0, -1, tick.index, tick.skipped});
    }
    core_.tick(tick.index, tick.cut - kGuard, sink);
    last_tick_.store(tick.index, std::memory_order_release);
    heartbeat_.beat(host_now());
    if (tick.index % kTicksPerSnapshot == 0) statistics_.write(beat.statistics());
  }
}

}  // namespace imuscope
