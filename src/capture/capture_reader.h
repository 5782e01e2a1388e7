#pragma once

/// Reads a capture: what was run, what went wrong, and every read and write in the order of arrival.

#include <chrono>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "capture/capture_files.h"
#include "capture/record_codec.h"
#include "capture/records.h"

namespace imuscope {

/// Bytes of a device that the recorder could not keep: from here on a replay is no longer exact.
struct CaptureLoss {
  std::string device;
  HostTime after{};          ///< arrival of the last record before the gap
  HostTime until{};          ///< of the first record after it
  std::int64_t records = 0;  ///< missing
};

/// What a capture holds of one device.
struct CapturedDevice {
  std::uint64_t reads = 0;
  std::uint64_t writes = 0;
  std::uint64_t bytes_read = 0;
  HostTime first{};
  HostTime last{};
};

/// A message of a person on PREFIX_EVENT.
struct RecordedEvent {
  HostTime time{};   ///< when the run heard it
  std::string text;  ///< one line, whatever was sent
};

/// A capture seen as a whole, by one pass over its files.
struct CaptureSummary {
  RunHeader run;         ///< empty where has_run is false
  bool has_run = false;  ///< false for a log of raw_t messages by another recorder, such as lcm-logger
  std::map<std::string, CapturedDevice> devices;
  std::vector<StoredException> exceptions;      ///< in file order; a replay needs them ahead of their ticks
  std::vector<applied_model_t> applied_models;  ///< in file order, needed like the exceptions
  std::vector<RecordedEvent> events;            ///< in file order; of a capture with a run alone
  std::vector<CaptureLoss> losses;
  std::vector<CaptureBreak> breaks;  ///< files that are missing or whose beginning is damaged
  std::uint64_t other_messages = 0;  ///< messages of other types, such as published ones
  std::vector<CapturedFile> files;   ///< in order
};

/// @param path     of the first file of the capture; those that follow are found beside it
/// @param progress is told the share of the present file that has been read; may be empty
/// @param beginning of the first file
/// @return an error that says what the file is where it is not a capture, and of kind kWork for an event log
///         that holds no device bytes
[[nodiscard]] Result<CaptureSummary> summarise_capture(
    const std::filesystem::path& path, const std::function<void(double share)>& progress = {},
    EventLogReader::Beginning beginning = EventLogReader::Beginning::kIsARecord);

/// The run header, where the first file begins with one: known long before the whole capture is seen.
[[nodiscard]] std::optional<RunHeader> run_header_of(const std::filesystem::path& path);

/// Sums over the files; the index is of none.
[[nodiscard]] LogHealth health_of(const std::vector<CapturedFile>& files);

/// Iterates over reads and writes ordered by arrival, equal arrivals by the order of the configuration, then
/// in the order in which they happened. Thread: one, non-real-time.
///
/// The file is in the order in which the recorder emptied its rings, which is nearly that of arrival. Reads
/// are held until the file is kReorderWindow further; what is out of order by more is given late and counted.
class CaptureReader {
 public:
  static constexpr Duration kReorderWindow = std::chrono::seconds(5);
  /// What six lines at their full rate bring in that window, many times over; where damaged stamps say that
  /// more belongs together, the oldest is given.
  static constexpr std::size_t kHeldMax = std::size_t{32} << 20U;

  /// @param path of the first file of the capture
  /// @param device whose reads and writes alone are wanted; empty: all. The others are passed over undecoded.
  static Result<CaptureReader> open(const std::filesystem::path& path, std::string device = {});

  /// The next read or write; nothing at the end of the capture. A read of which a piece was lost comes as the
  /// pieces that are there.
  [[nodiscard]] std::optional<RawRead> next();
  /// The same, in the memory of one that is of no use any more: false at the end.
  [[nodiscard]] bool next(RawRead& read);

  /// Reads that were out of order by more than the window.
  [[nodiscard]] std::uint64_t disordered() const noexcept { return disordered_; }

 private:
  /// Position of a read in the order of the replay.
  struct Key {
    HostTime arrival;
    std::size_t device;
    std::uint64_t order;  // of completion within the file
    // clang-tidy 14 takes the 0 of the comparison that the compiler writes for a pointer.
    auto operator<=>(const Key&) const = default;  // NOLINT(modernize-use-nullptr)
  };
  struct Assembly {
    RawRead read;
    std::int64_t next_sequence = 0;
    bool open = false;  // pieces are still to come
  };

  CaptureReader(CaptureFiles log, std::string wanted) : log_(std::move(log)), wanted_(std::move(wanted)) {}
  bool read_one();
  void add_piece(const RawView& piece);
  void close_assemblies();
  void add_whole(RawRead&& read);
  RawRead read_of(const RawView& piece);
  std::size_t index_of(const std::string& device);

  CaptureFiles log_;
  std::string wanted_;  ///< device; empty: all
  std::vector<std::string> devices_;
  std::map<std::string, Assembly, std::less<>> assemblies_;
  struct Held {
    Key key;
    RawRead read;
  };
  std::deque<Held> held_;        ///< rising; nearly all that comes belongs to its end
  std::vector<RawRead> spares_;  ///< kept for their memory
  std::size_t held_bytes_ = 0;
  std::uint64_t completed_ = 0;
  HostTime newest_ = HostTime::min();
  HostTime given_ = HostTime::min();
  std::uint64_t disordered_ = 0;
  bool ended_ = false;
};

}  // namespace imuscope
