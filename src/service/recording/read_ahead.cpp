#include "service/recording/read_ahead.h"

#include <utility>

namespace imuscope {

namespace {

/// Reads handed on at once: so many that the lock costs nothing beside them.
constexpr std::size_t kBlockReads = 1024;
/// Or fewer where they are long: what is ready stays below kReadyBlocks times this and one read.
constexpr std::size_t kBlockBytes = std::size_t{1} << 20U;
constexpr std::size_t kReadyBlocks = 4;

}  // namespace

ReadAhead::ReadAhead(CaptureReader reader) : reader_(std::move(reader)), thread_([this] { read_all(); }) {}

ReadAhead::~ReadAhead() {
  {
    const std::lock_guard lock(mutex_);
    unwanted_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

std::optional<RawRead> ReadAhead::next() {
  if (at_ == current_.size()) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_ || !ready_.empty(); });
    if (ready_.empty()) return std::nullopt;
    current_ = std::move(ready_.front());
    ready_.pop_front();
    at_ = 0;
    lock.unlock();
    changed_.notify_all();
  }
  return std::move(current_[at_++]);
}

void ReadAhead::read_all() {
  Block block;
  std::size_t bytes = 0;
  while (auto read = reader_.next()) {
    bytes += read->bytes.size();
    block.push_back(std::move(*read));
    if (block.size() < kBlockReads && bytes < kBlockBytes) continue;
    if (!hand_on(std::exchange(block, {}))) return;
    bytes = 0;
  }
  if (!block.empty() && !hand_on(std::move(block))) return;
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

bool ReadAhead::hand_on(Block&& block) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return unwanted_ || ready_.size() < kReadyBlocks; });
  if (unwanted_) return false;
  ready_.push_back(std::move(block));
  lock.unlock();
  changed_.notify_all();
  return true;
}

}  // namespace imuscope
