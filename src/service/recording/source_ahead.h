#pragma once

/// Any source read in a thread of its own, ahead of those who use it. What comes out, and in which order, is
/// what the source itself would give. Non-real-time: threads, a lock, allocates.

#include <memory>
#include <thread>
#include <vector>

#include "service/recording/bounded_queue.h"
#include "service/recording/byte_source.h"

namespace imuscope {

class SourceAhead final : public ByteSource {
 public:
  explicit SourceAhead(std::unique_ptr<ByteSource> source);
  /// Ends the thread, wherever it is.
  ~SourceAhead() override;
  SourceAhead(const SourceAhead&) = delete;
  SourceAhead& operator=(const SourceAhead&) = delete;

  Result<std::optional<RecordedRead>> next() override;
  [[nodiscard]] std::uint64_t bytes_read() const override { return read_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return total_; }

 private:
  /// Reads, whose bytes stand one behind the other, and what ended them.
  struct Block {
    std::vector<RecordedRead> reads;
    std::vector<std::size_t> ends;
    std::vector<std::uint8_t> bytes;
    std::optional<Error> error;
  };
  void read_all();

  std::unique_ptr<ByteSource> source_;  ///< of the thread alone
  std::uint64_t total_;
  BoundedQueue<Block> ready_;
  Block current_;
  std::size_t at_ = 0;
  std::uint64_t read_ = 0;
  std::thread thread_;  ///< last, as it uses the others
};

}  // namespace imuscope
