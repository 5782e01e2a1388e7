#include "service/recording/sink_beside.h"

#include <utility>

namespace imuscope {

namespace {

/// Handed on at once: so much that the lock costs nothing beside it. What waits stays below kReadyResults times
/// this.
constexpr std::size_t kBlockOfResults_bytes = std::size_t{1} << 18U;
constexpr std::size_t kReadyResults = 4;
/// Besides those that wait: one is worked off, one is full, and one is to follow it.
constexpr std::size_t kBlocks = kReadyResults + 3;

}  // namespace

SinkBeside::SinkBeside(CoreSink& behind)
    : behind_(behind), ready_(kReadyResults), worked_off_(kBlocks), thread_([this] {
        while (auto block = ready_.pop()) {
          work_off(*block);
          worked_off_.push(std::move(*block));
        }
      }) {}

SinkBeside::Block SinkBeside::empty_block() {
  Block block = worked_off_.pop_if_ready().value_or(Block{});
  block.order.clear();
  block.epochs.clear();
  block.errors.clear();
  block.events.clear();
  block.snapshots.clear();
  block.late_samples.clear();
  block.applied_noises.clear();
  block.bytes = 0;
  return block;
}

SinkBeside::~SinkBeside() {
  ready_.push(std::move(block_));
  ready_.end();
  worked_off_.refuse();
  thread_.join();
}

template <typename T>
void SinkBeside::keep(Kind kind, std::vector<T>& of_kind, const T& one) {
  block_.order.push_back(kind);
  of_kind.push_back(one);
  block_.bytes += sizeof(T);
  if (block_.bytes >= kBlockOfResults_bytes) ready_.push(std::exchange(block_, empty_block()));
}

void SinkBeside::on_epoch(const SImuEpoch& epoch, const TickFacts& facts) noexcept {
  keep(Kind::kEpoch, block_.epochs, {epoch, facts});
}
void SinkBeside::on_error(const ErrorRecord& record) noexcept { keep(Kind::kError, block_.errors, record); }
void SinkBeside::on_event(const EstimatorEvent& event) noexcept { keep(Kind::kEvent, block_.events, event); }
void SinkBeside::on_snapshot(const Snapshot& snapshot) noexcept {
  keep(Kind::kSnapshot, block_.snapshots, snapshot);
}
void SinkBeside::on_late_sample(const LateSample& late) noexcept {
  keep(Kind::kLateSample, block_.late_samples, late);
}
void SinkBeside::on_noise_applied(const AppliedNoise& applied) noexcept {
  keep(Kind::kAppliedNoise, block_.applied_noises, applied);
}

void SinkBeside::work_off(const Block& block) {
  auto epoch = block.epochs.begin();
  auto error = block.errors.begin();
  auto event = block.events.begin();
  auto snapshot = block.snapshots.begin();
  auto late = block.late_samples.begin();
  auto applied = block.applied_noises.begin();
  for (const Kind kind : block.order) {
    switch (kind) {
      case Kind::kEpoch:
        behind_.on_epoch(epoch->epoch, epoch->facts);
        ++epoch;
        break;
      case Kind::kError:
        behind_.on_error(*error++);
        break;
      case Kind::kEvent:
        behind_.on_event(*event++);
        break;
      case Kind::kSnapshot:
        behind_.on_snapshot(*snapshot++);
        break;
      case Kind::kLateSample:
        behind_.on_late_sample(*late++);
        break;
      case Kind::kAppliedNoise:
        behind_.on_noise_applied(*applied++);
        break;
    }
  }
}

}  // namespace imuscope
