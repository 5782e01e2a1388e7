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
    : reader_(std::move(reader)), ready_(kReadyBlocks), thread_([this] { read_all(); }) {}

ReadAhead::~ReadAhead() {
  ready_.refuse();
  thread_.join();
}

std::optional<RawRead> ReadAhead::next() {
  if (at_ == current_.size()) {
    auto block = ready_.pop();
    if (!block) return std::nullopt;
    current_ = std::move(*block);
    at_ = 0;
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
    if (!ready_.push(std::exchange(block, {}))) return;
    bytes = 0;
  }
  if (!block.empty() && !ready_.push(std::move(block))) return;
  ready_.end();
}

}  // namespace imuscope
