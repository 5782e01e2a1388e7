#pragma once

/// A capture read in a thread of its own, some thousand reads ahead of those who use them. What comes out,
/// and in which order, is what the reader itself would give. Non-real-time: threads, a lock, allocates.

#include <cstddef>
#include <thread>
#include <vector>

#include "capture/capture_reader.h"
#include "service/recording/bounded_queue.h"

namespace imuscope {

class ReadAhead {
 public:
  explicit ReadAhead(CaptureReader reader);
  /// Ends the thread, wherever it is.
  ~ReadAhead();
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// The next read or write, in the memory of one that is of no use any more; false at the end of the capture.
  /// Thread: one.
  [[nodiscard]] bool next(RawRead& read);

 private:
  using Block = std::vector<RawRead>;
  void read_all();

  CaptureReader reader_;  ///< of the thread alone
  BoundedQueue<Block> ready_;
  BoundedQueue<Block> used_;  ///< for their memory, the other way
  Block current_;
  std::size_t at_ = 0;
  std::thread thread_;  ///< last, as it uses all of the others
};

}  // namespace imuscope
