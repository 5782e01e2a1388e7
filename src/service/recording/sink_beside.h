#pragma once

/// What comes out of a replay's core, worked on in a thread of its own: rows are written and noise models
/// follow beside the filter. What comes out, and in which order, is what the core gives. Non-real-time:
/// threads, a lock, allocates.

#include <thread>
#include <vector>

#include "service/pipeline/core.h"
#include "service/recording/bounded_queue.h"

namespace imuscope {

class SinkBeside final : public CoreSink {
 public:
  /// @param behind  does the work; until this one is gone, its thread is the only one that may use it
  explicit SinkBeside(CoreSink& behind);
  /// Waits until all that came has been worked on.
  ~SinkBeside() override;
  SinkBeside(const SinkBeside&) = delete;
  SinkBeside& operator=(const SinkBeside&) = delete;

  void on_epoch(const SImuEpoch& epoch, const TickFacts& facts) noexcept override;
  void on_error(const ErrorRecord& record) noexcept override;
  void on_event(const EstimatorEvent& event) noexcept override;
  void on_snapshot(const Snapshot& snapshot) noexcept override;
  void on_late_sample(const LateSample& late) noexcept override;
  void on_noise_applied(const AppliedNoise& applied) noexcept override;

 private:
  struct Epoch {
    SImuEpoch epoch;
    TickFacts facts;
  };
  enum class Kind : std::uint8_t { kEpoch, kError, kEvent, kSnapshot, kLateSample, kAppliedNoise };
  /// What came, kind by kind, and the order in which it did.
  struct Block {
    std::vector<Kind> order;
    std::vector<Epoch> epochs;
    std::vector<ErrorRecord> errors;
    std::vector<EstimatorEvent> events;
    std::vector<Snapshot> snapshots;
    std::vector<LateSample> late_samples;
    std::vector<AppliedNoise> applied_noises;
    std::size_t bytes = 0;
  };
  /// One that has been worked off, where there is one: its vectors have grown to what a block needs.
  Block empty_block();
  template <typename T>
  void keep(Kind kind, std::vector<T>& of_kind, const T& one);
  void work_off(const Block& block);

  CoreSink& behind_;
  BoundedQueue<Block> ready_;
  BoundedQueue<Block> worked_off_;
  Block block_;
  std::thread thread_;  ///< last, as it uses the others
};

}  // namespace imuscope
