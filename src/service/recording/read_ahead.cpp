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

ReadAhead::ReadAhead(CaptureReader reader)
    : reader_(std::move(reader)),
      ready_(kReadyBlocks),
      // With the one that is being read and the one that is being used: nobody waits for room here.
      used_(kReadyBlocks + 2),
      thread_([this] { read_all(); }) {}

ReadAhead::~ReadAhead() {
  ready_.refuse();
  thread_.join();
}

bool ReadAhead::next(RawRead& read) {
  if (at_ == current_.size()) {
    auto block = ready_.pop();
    if (!block) return false;
    if (!current_.empty()) used_.push(std::move(current_));
    current_ = std::move(*block);
    at_ = 0;
  }
  std::swap(read, current_[at_++]);
  return true;
}

void ReadAhead::read_all() {
  for (bool goes_on = true; goes_on;) {
    Block block = used_.pop_if_ready().value_or(Block{});
    std::size_t n = 0;
    for (std::size_t bytes = 0; n < kBlockReads && bytes < kBlockBytes; ++n) {
      if (n == block.size()) block.emplace_back();
      goes_on = reader_.next(block[n]);
      if (!goes_on) break;
      bytes += block[n].bytes.size();
    }
    block.resize(n);
    if (n > 0 && !ready_.push(std::move(block))) return;
  }
  ready_.end();
}

}  // namespace imuscope
