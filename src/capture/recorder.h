#pragma once

/// The recorder thread: empties the rings of raw bytes and exceptions into a capture.

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/result.h"
#include "capture/capture_writer.h"
#include "capture/event_log.h"
#include "capture/record_codec.h"
#include "capture/records.h"
#include "publish/channel_name.h"
#include "rt/heartbeat.h"
#include "rt/host_clock.h"

namespace imuscope {

/// What the recorder says about itself. Losses in the rings are counted there (SpscRing::counters()).
struct RecorderStatus {
  std::filesystem::path path;  ///< of the file being written
  std::uint64_t bytes = 0;     ///< of all files, safe from the death of this process
  std::uint64_t records = 0;
  std::uint64_t records_lost = 0;   ///< refused by the disk
  std::uint64_t messages_lost = 0;  ///< given to record_message() too fast
  /// Of the last flush, with the remedy; where it worked, that a file was removed while it was recorded.
  std::optional<Error> problem;
};

/// As top and the kernel show its thread.
inline constexpr const char* kRecorderThreadName = "imuscope-rec";

/// Back-pressure ends here: a slow or full disk makes the recorder lose records (counted, visible to the
/// capture's reader as gaps in the sequences), never an I/O thread wait.
///
/// Threads: start(), stop() and the destructor from one; status() from any non-real-time thread. The rings
/// must outlive the recorder, whose thread is their only consumer.
class Recorder {
 public:
  /// Where the capture goes, and when it goes on in another file.
  struct Options {
    std::filesystem::path path;  ///< must not exist yet
    std::string channel_prefix{kDefaultChannelPrefix};
    RunHeader run;  ///< run.devices names what DeviceIndex counts
    /// The capture goes on in another file (see capture_files.h) when one has this size or age; 0 means
    /// never.
    std::uint64_t max_file_bytes = std::uint64_t{2} << 30U;
    Duration max_file_age = std::chrono::hours(1);
    /// What was recorded is on the disk after this time: a cut of the power costs no more than what came in
    /// it and while the disk wrote.
    Duration sync_interval = std::chrono::milliseconds(500);
    /// Sees every chunk that is recorded, in the recorder's thread; must not wait. May be empty.
    std::function<void(const RawChunk&)> raw_tap{};
  };

  /// Creates the capture, writes the run header and starts the thread.
  static Result<std::unique_ptr<Recorder>> start(Options options, std::vector<RawRing*> raw_rings,
                                                 std::vector<ExceptionRing*> exception_rings);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Adds a published message, so that the capture shows the run in lcm-logplayer and lcm-spy, too. A replay
  /// passes over it. Any non-real-time thread. A message that finds too many waiting is counted as lost.
  void record_message(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> message);
  /// The same for a message of somebody else's that was heard at `heard`: stamped as the capture's reader
  /// maps times back, whatever the PC's wall clock was set to meanwhile.
  void record_heard(std::string_view channel, HostTime heard, std::span<const std::uint8_t> message);

  /// Records what is still in the rings, completes the file, ends the thread. Call after the producers ended.
  /// @return the problem of the last flush, if any
  Result<void> stop();

  [[nodiscard]] RecorderStatus status() const;
  [[nodiscard]] const Heartbeat& heartbeat() const { return heartbeat_; }

 private:
  Recorder(Options options, std::unique_ptr<CaptureWriter> writer, std::vector<RawRing*> raw_rings,
           std::vector<ExceptionRing*> exception_rings);
  void run();
  void drain();
  bool drain_oldest_chunk();
  void drain_exceptions();
  void drain_messages();
  static Result<std::unique_ptr<CaptureWriter>> begin_file(const Options& options, int number);
  void flush();
  void sync();
  void rotate_if_due();
  void update_status(const Result<void>& flushed);

  Options options_;
  RecordClock clock_;
  std::vector<std::string> raw_channels_;  // by DeviceIndex
  std::string exception_channel_;
  std::vector<RawRing*> raw_rings_;
  std::vector<ExceptionRing*> exception_rings_;
  std::unique_ptr<CaptureWriter> writer_;
  int file_number_ = 0;
  HostTime file_begin_;
  RecorderStatus finished_;  // of the files before this one
  std::int64_t exceptions_ = 0;

  mutable std::mutex messages_mutex_;
  std::vector<LogEvent> messages_;
  std::size_t messages_bytes_ = 0;
  std::uint64_t messages_lost_ = 0;

  mutable std::mutex status_mutex_;
  RecorderStatus status_;
  Heartbeat heartbeat_{host_now()};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace imuscope
