#pragma once

/// Reads an event log and believes its seals: what they say is damaged is passed over and counted.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/result.h"
#include "capture/event_log_reader.h"
#include "capture/seal.h"

namespace imuscope {

/// What is known of one file once it was read to its end.
struct LogHealth {
  std::uint64_t bytes_skipped = 0;     ///< see EventLogReader
  std::uint64_t bytes_cut_off = 0;     ///< likewise
  std::uint64_t records_damaged = 0;   ///< do not agree with their checksums; passed over
  std::uint64_t records_missing = 0;   ///< that a seal names and the file does not hold
  std::uint64_t records_unsealed = 0;  ///< taken as they are: no seal says anything of them
  bool is_sealed = false;              ///< false for a log without any seal, such as one of an older version
  /// With which the file ends; a file without one was cut off.
  std::optional<capture_index_t> index;
};

/// Iterates over the records of a log in file order, without the seals and the index. Records are held until
/// their seal, which follows within the writer's flush; in a log without seals they are given at once.
/// Thread: one, non-real-time.
class SealedLog {
 public:
  static Result<SealedLog> open(const std::filesystem::path& path,
                                EventLogReader::Beginning beginning = EventLogReader::Beginning::kIsARecord);

  /// Where the next record begins, if nothing is held between here and what was given: a place for go_to().
  [[nodiscard]] std::optional<std::uint64_t> place() const;
  /// Goes on from there. What is told of the file's health is of what was read.
  void go_to(std::uint64_t place);

  /// See EventLogReader.
  void on_read(std::function<void(std::uint64_t bytes)> listener) { log_.on_read(std::move(listener)); }

  /// Records whose data nobody wants: passed over. They are not held against their seal either, and count as missing
  /// in health().
  using Unwanted = std::function<bool(std::span<const std::uint8_t> data)>;
  void pass_over(Unwanted unwanted) { unwanted_ = std::move(unwanted); }

  /// Fetches the next record, which stays where it is until the next call. Returns false at the end of the file.
  [[nodiscard]] bool next(LogEventView& event);
  /// The same as a copy.
  [[nodiscard]] bool next(LogEvent& event) { return copy_next(*this, event); }

  /// So far.
  [[nodiscard]] LogHealth health() const;

 private:
  explicit SealedLog(EventLogReader log) : log_(std::move(log)) {}
  void take(const LogEventView& event);
  void release_what_waited_long();
  void check(const capture_seal_t& seal);
  void release_all();

  EventLogReader log_;
  Unwanted unwanted_;
  std::optional<std::uint64_t> index_;  ///< place of one that was read last
  std::deque<std::uint64_t> held_;      ///< places of records, whose bytes the reader keeps
  std::size_t released_ = 0;            ///< of those held, from the front
  std::uint64_t given_unsealed_ = 0;    ///< since the last seal
  LogHealth health_;
};

}  // namespace imuscope
