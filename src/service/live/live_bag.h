#pragma once

/// The MCAP file of a live run (logs/bag/bag_writer.h), written while it goes on: [record] mcap = true. The
/// capture stays the record of the run; this is the same for other people's tools, with the estimates as they
/// stood.
///
/// It decodes what the recorder's thread has taken from the core's ring once more, with decoders of its own,
/// in a thread of its own: the core knows nothing of it.

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "capture/raw_chunk.h"
#include "configuration/config.h"
#include "drivers/device/device.h"
#include "logs/bag/bag_writer.h"
#include "rt/heartbeat.h"
#include "rt/host_clock.h"
#include "service/pipeline/core.h"
#include "service/pipeline/refit.h"

namespace imuscope {

/// As top and the kernel show its thread.
inline constexpr const char* kBagThreadName = "imuscope-bag";
/// In the run's folder.
inline constexpr const char* kBagFileName = "run.mcap";

/// Threads: on_...() from any non-real-time thread, the rest from the caller's. What comes while too much
/// waits (a disk that stands still) is lost and counted; nobody waits for this file.
class LiveBag {
 public:
  /// Begins the file and the thread. The configuration must outlive it.
  static Result<std::unique_ptr<LiveBag>> start(const Configuration& configuration,
                                                const OutputFolder& folder, const std::string& version);
  ~LiveBag();
  LiveBag(const LiveBag&) = delete;
  LiveBag& operator=(const LiveBag&) = delete;

  /// A piece of a read, as it is recorded.
  void on_chunk(const RawChunk& chunk);
  void on_snapshot(const Snapshot& snapshot);
  void on_refit(const Refit& refit);
  /// A message of ours, as it is published.
  void on_message(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> message);

  /// What is wrong with the disk, or lost to it.
  [[nodiscard]] std::optional<Error> problem() const;
  [[nodiscard]] const Heartbeat& heartbeat() const noexcept { return heartbeat_; }
  /// Writes what is left and the run's documents of `folder`, completes the file. Call when everything has
  /// come.
  [[nodiscard]] Result<void> finish(const OutputFolder& folder);

 private:
  struct Read {
    DeviceIndex device = 0;
    HostTime arrival{};
    HostTime received{};
    std::optional<Duration> per_byte;
    std::vector<std::uint8_t> bytes;
  };
  struct Message {
    std::string channel;
    std::int64_t utime = 0;
    std::vector<std::uint8_t> bytes;
  };
  /// What came and is not written yet.
  struct Waiting {
    std::vector<Read> reads;
    std::vector<Message> messages;
    std::vector<Snapshot> snapshots;
    std::vector<Refit> refits;
    std::size_t bytes = 0;
  };
  class Decoded final : public SampleSink {
   public:
    void on_sample(const Sample& sample) noexcept override { samples.push_back(sample); }
    std::deque<Sample> samples;
  };

  LiveBag(const Configuration& configuration, OutputFile file, const std::string& version);
  [[nodiscard]] bool has_room(std::size_t bytes);
  void loop();
  void write_waiting(bool at_end);
  void take(const Snapshot& snapshot);
  void take(const Refit& refit);
  void take(const Message& message);
  void take(const Read& read);
  [[nodiscard]] std::string topic_of(const std::string& channel, const std::string& type) const;
  void write_samples(bool at_end);
  void write_mountings();

  const Configuration& configuration_;
  std::vector<std::size_t> study_devices_;
  OutputFile file_;
  bag::BagWriter writer_;
  std::vector<std::unique_ptr<DeviceDecoder>> decoders_;
  Decoded decoded_;
  std::optional<Snapshot> last_;
  HostTime begun_;
  HostTime mountings_told_{};
  HostTime chunk_ended_{};
  /// By study and regime: what the filter takes it to be, then what the newest refit says.
  std::vector<std::array<bag::WhiteVariance, kRegimeCount>> variances_;

  mutable std::mutex mutex_;
  Waiting waiting_;
  std::vector<Read> unfinished_;  ///< by device: the pieces of a read that came so far
  std::uint64_t lost_ = 0;
  std::optional<Error> disk_problem_;
  Heartbeat heartbeat_{host_now()};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace imuscope
