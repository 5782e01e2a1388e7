#pragma once

/// A capture in several files: what the recorder splits, the reader joins.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "base/result.h"
#include "capture/records.h"
#include "capture/sealed_log.h"

namespace imuscope {

/// Path of file n of a capture: run.lcm, run_001.lcm, run_002.lcm, ...
[[nodiscard]] std::filesystem::path capture_file(const std::filesystem::path& first, int n);

/// A place between two files of a capture where something is missing.
struct CaptureBreak {
  int first_missing = 0;              ///< number of the first file that is not there or cannot be read
  int n_missing = 0;                  ///< files in a row
  int behind = 0;                     ///< number of the file with which it goes on
  bool beginning_is_damaged = false;  ///< of that file
  double seconds = 0.0;  ///< between the last read before and the first after, by the recorder's clock
};

/// One file of a capture that was read to its end.
struct CapturedFile {
  int number = 0;
  LogHealth health;
};

/// Iterates over the events of a capture through all its files, given the first. A file belongs to the
/// capture if it begins with a run header of the same t0; what lies beside it from another run is left alone.
/// Files that are missing or unreadable in between are passed over, and so is the damaged beginning of one
/// whose records follow in time: breaks() tells of them. Records that a seal says are damaged are passed
/// over, too: files() tells of them. Thread: one, non-real-time.
class CaptureFiles {
 public:
  /// @param beginning  of the first file
  static Result<CaptureFiles> open(
      const std::filesystem::path& first,
      EventLogReader::Beginning beginning = EventLogReader::Beginning::kIsARecord);

  /// Is told how much of the present file has been read, 0 to 1.
  void on_read(const std::function<void(double share)>& listener);

  /// See SealedLog: what files() says then is of no use.
  void pass_over(const SealedLog::Unwanted& unwanted);

  /// Fetches the next event, which stays where it is until the next call. Returns false at the end of the last file.
  [[nodiscard]] bool next(LogEventView& event);
  /// The same as a copy.
  [[nodiscard]] bool next(LogEvent& event) { return copy_next(*this, event); }

  /// Somewhere in a capture that is read again from there.
  struct Place {
    int number = 0;            ///< of the file
    std::uint64_t offset = 0;  ///< in it
  };
  /// Of the next event, where the reader stands between what its seals cover.
  [[nodiscard]] std::optional<Place> place() const;
  /// Goes on from there. Errors: those of a file that is no longer there.
  Result<void> go_to(const Place& place);

  /// Those that were begun so far.
  [[nodiscard]] std::vector<CapturedFile> files() const;
  /// Of the present one.
  [[nodiscard]] int number() const noexcept { return number_; }
  /// So far.
  [[nodiscard]] const std::vector<CaptureBreak>& breaks() const noexcept { return breaks_; }

 private:
  CaptureFiles(std::filesystem::path first, SealedLog log) : first_(std::move(first)), log_(std::move(log)) {}
  bool open_following();
  [[nodiscard]] std::optional<CaptureBreak> joins(int number) const;
  [[nodiscard]] std::optional<HostTime> t0_of_others() const;
  void report_reads();
  void begin_file(SealedLog log, int number);

  std::filesystem::path first_;
  std::function<void(double)> on_read_;
  SealedLog::Unwanted unwanted_;
  int number_ = 0;
  SealedLog log_;
  bool at_beginning_ = true;
  std::optional<HostTime> t0_;
  std::optional<std::int64_t> last_read_utime_;  ///< by the recorder's clock; none: no device has sent yet
  std::vector<CaptureBreak> breaks_;
  std::vector<CapturedFile> finished_;
};

}  // namespace imuscope
