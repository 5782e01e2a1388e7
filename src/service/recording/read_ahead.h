#pragma once

/// A capture read in a thread of its own, some thousand reads ahead of those who use them. What comes out,
/// and in which order, is what the reader itself would give. Non-real-time: threads, a lock, allocates.

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "capture/capture_reader.h"

namespace imuscope {

class ReadAhead {
 public:
  explicit ReadAhead(CaptureReader reader);
  /// Ends the thread, wherever it is.
  ~ReadAhead();
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// The next read or write; nothing at the end of the capture. Thread: one.
  [[nodiscard]] std::optional<RawRead> next();

 private:
  using Block = std::vector<RawRead>;
  void read_all();
  /// @return false where nobody wants more
  bool hand_on(Block&& block);

  CaptureReader reader_;  ///< of the thread alone
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Block> ready_;
  bool ended_ = false;
  bool unwanted_ = false;
  Block current_;
  std::size_t at_ = 0;
  std::thread thread_;  ///< last, as it uses all of the others
};

}  // namespace imuscope
