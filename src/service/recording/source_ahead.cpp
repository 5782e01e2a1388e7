#include "service/recording/source_ahead.h"

#include <utility>

namespace imuscope {

namespace {

/// Reads handed on at once: so many that the lock costs nothing beside them.
constexpr std::size_t kPieceReads = 1024;
/// Or fewer where they are long: what is ready stays below kReadyPieces times this and one read.
constexpr std::size_t kPieceBytes = std::size_t{1} << 18U;
constexpr std::size_t kReadyPieces = 4;

}  // namespace

SourceAhead::SourceAhead(std::unique_ptr<ByteSource> source)
    : source_(std::move(source)),
      total_(source_->bytes_total()),
      ready_(kReadyPieces),
      thread_([this] { read_all(); }) {}

SourceAhead::~SourceAhead() {
  ready_.refuse();
  thread_.join();
}

void SourceAhead::read_all() {
  Block block;
  for (;;) {
    auto read = source_->next();
    if (!read) block.error = read.error();
    if (!read || !*read) break;
    block.bytes.insert(block.bytes.end(), (*read)->bytes.begin(), (*read)->bytes.end());
    block.ends.push_back(block.bytes.size());
    block.reads.push_back(**read);
    if (block.reads.size() < kPieceReads && block.bytes.size() < kPieceBytes) continue;
    if (!ready_.push(std::exchange(block, {}))) return;
  }
  if (ready_.push(std::move(block))) ready_.end();
}

Result<std::optional<RecordedRead>> SourceAhead::next() {
  while (at_ == current_.reads.size()) {
    if (current_.error) return tl::unexpected<Error>(*current_.error);
    auto block = ready_.pop();
    if (!block) return std::optional<RecordedRead>{};
    current_ = std::move(*block);
    at_ = 0;
  }
  const std::size_t begin = at_ == 0 ? 0 : current_.ends[at_ - 1];
  RecordedRead read = current_.reads[at_];
  read.bytes = {current_.bytes.data() + begin, current_.ends[at_] - begin};
  ++at_;
  read_ += read.bytes.size();
  return std::optional<RecordedRead>{read};
}

}  // namespace imuscope
