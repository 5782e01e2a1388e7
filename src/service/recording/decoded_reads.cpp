#include "service/recording/decoded_reads.h"

#include <utility>

#include "service/recording/sample_collector.h"

namespace imuscope {

namespace {

/// Reads handed on at once: so many that the lock costs nothing beside them.
constexpr std::size_t kPieceReads = 4096;
/// Or fewer where they bring more samples than that.
constexpr std::size_t kPieceSamples = 1024;
constexpr std::size_t kReadyPieces = 4;

}  // namespace

DecodedReads::DecodedReads(std::unique_ptr<ByteSource> source, std::unique_ptr<DeviceDecoder> decoder,
                           bool is_ahead)
    : source_(std::move(source)),
      decoder_(std::move(decoder)),
      total_(source_->bytes_total()),
      ready_(kReadyPieces) {
  if (!is_ahead) return;
  thread_ = std::thread([this] {
    for (bool goes_on = true; goes_on;) {
      Block block;
      goes_on = fill(block, kPieceReads);
      if (!ready_.push(std::move(block))) return;
    }
    ready_.end();
  });
}

DecodedReads::~DecodedReads() { end_thread(); }

void DecodedReads::end_thread() {
  if (!thread_.joinable()) return;
  ready_.refuse();
  thread_.join();
}

const DeviceDecoder& DecodedReads::decoder() {
  end_thread();
  return *decoder_;
}

bool DecodedReads::fill(Block& block, std::size_t reads) {
  SampleCollector collector(block.samples);
  const auto fetch = [&] {
    auto read = source_->next();
    if (!read) block.error = read.error();
    pending_ = read ? *read : std::nullopt;
  };
  if (!std::exchange(has_begun_, true)) fetch();
  while (pending_ && block.reads.size() < reads && block.samples.size() < kPieceSamples) {
    const std::optional<HostTime> arrival = pending_->arrival;
    const HostTime stamp = arrival.value_or(HostTime{});
    if (pending_->per_byte) decoder_->set_per_byte(*pending_->per_byte);
    decoder_->push(pending_->bytes, {stamp, pending_->received.value_or(stamp)}, collector);
    bytes_ += pending_->bytes.size();
    fetch();
    if (!pending_ && !block.error) decoder_->finish(stamp, collector);
    block.reads.push_back({arrival, bytes_, block.samples.size()});
  }
  return pending_.has_value();
}

Result<std::optional<DecodedRead>> DecodedReads::next() {
  while (at_ == current_.reads.size()) {
    if (current_.error) return tl::unexpected<Error>(*current_.error);
    if (has_ended_) return std::optional<DecodedRead>{};
    at_ = 0;
    if (thread_.joinable()) {
      auto block = ready_.pop();
      has_ended_ = !block;
      current_ = block ? std::move(*block) : Block{};
    } else {
      current_.reads.clear();
      current_.samples.clear();
      has_ended_ = !fill(current_, 1);
    }
  }
  const std::size_t begin = at_ == 0 ? 0 : current_.reads[at_ - 1].samples_end;
  const Read& read = current_.reads[at_++];
  return std::optional<DecodedRead>{
      DecodedRead{read.arrival, read.bytes_so_far,
                  std::span<const Sample>(current_.samples).subspan(begin, read.samples_end - begin)}};
}

}  // namespace imuscope
