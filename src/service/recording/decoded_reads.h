#pragma once

/// The samples of one device of a recording, read by read: decoded when they are asked for, or in a thread of
/// their own ahead of those who use them. What comes out, and in which order, is the same. Non-real-time.

#include <memory>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "drivers/device/device.h"
#include "service/recording/bounded_queue.h"
#include "service/recording/byte_source.h"

namespace imuscope {

/// What one read brought; the samples stay valid until the next call of next().
struct DecodedRead {
  std::optional<HostTime> arrival;  ///< absent in recordings without arrival stamps
  std::uint64_t bytes_so_far = 0;   ///< of the source, with this read
  std::span<const Sample> samples;
};

/// Thread: one.
class DecodedReads {
 public:
  /// @param is_ahead  in a thread of its own; `source` and `decoder` then are that thread's until the end
  DecodedReads(std::unique_ptr<ByteSource> source, std::unique_ptr<DeviceDecoder> decoder, bool is_ahead);
  /// Ends the thread, wherever it is.
  ~DecodedReads();
  DecodedReads(const DecodedReads&) = delete;
  DecodedReads& operator=(const DecodedReads&) = delete;

  /// The next read; with the last one comes what the decoder gives at the end. Nothing after that.
  Result<std::optional<DecodedRead>> next();

  [[nodiscard]] std::uint64_t bytes_total() const { return total_; }
  /// Waits for the thread's end, which next() has brought or which this brings.
  [[nodiscard]] const DeviceDecoder& decoder();

 private:
  struct Read {
    std::optional<HostTime> arrival;
    std::uint64_t bytes_so_far;
    std::size_t samples_end;
  };
  /// Reads, whose samples stand one behind the other, and what ended them.
  struct Block {
    std::vector<Read> reads;
    std::vector<Sample> samples;
    std::optional<Error> error;
  };
  /// Decodes reads into `block` until it is full. @return false at the end of the source, or with an error
  bool fill(Block& block, std::size_t reads);
  void end_thread();

  std::unique_ptr<ByteSource> source_;
  std::unique_ptr<DeviceDecoder> decoder_;
  std::uint64_t total_;
  std::optional<RecordedRead> pending_;  ///< fetched, not decoded: whether a read is the last is known before
  bool has_begun_ = false;
  bool has_ended_ = false;
  std::uint64_t bytes_ = 0;
  Block current_;
  std::size_t at_ = 0;
  BoundedQueue<Block> ready_;
  std::thread thread_;  ///< last, as it uses the others
};

}  // namespace imuscope
