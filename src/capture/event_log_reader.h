#pragma once

/// Reads any LCM event log, whole or damaged.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "capture/event_log.h"

namespace imuscope {

/// Iterates over the events in file order. Damage never stops it: after bytes that are no record it goes on
/// at the next whole record and counts what lay between. A record that the end of the file cuts off is the
/// normal end of a capture whose recorder was killed: it is counted apart. Thread: one, non-real-time.
class EventLogReader {
 public:
  /// Whether a file that does not begin with a record is another kind of file, or may be one of ours whose
  /// beginning is damaged: then the bytes up to its first record are skipped.
  enum class Beginning : std::uint8_t { kIsARecord, kMayBeDamaged };

  /// Errors name what is there instead: nothing, a folder, an empty file, another kind of file.
  static Result<EventLogReader> open(const std::filesystem::path& path,
                                     Beginning beginning = Beginning::kIsARecord);

  /// Is told, now and then, how many bytes of the file have been read.
  void on_read(std::function<void(std::uint64_t bytes)> listener) { on_read_ = std::move(listener); }

  /// Fetches the next event, which stays where it is until the next call. Returns false at the end of the file. Where
  /// something is kept, look_for() is the one to call.
  [[nodiscard]] bool next(LogEventView& event) { return look_for(event) == Next::kEvent; }
  /// The same as a copy.
  [[nodiscard]] bool next(LogEvent& event) { return copy_next(*this, event); }

  /// Bytes of the file before the next event; go_to() goes on from such a place.
  [[nodiscard]] std::uint64_t place() const noexcept { return read_ - (end_ - begin_); }
  /// Bytes of the file before the event that was given last.
  [[nodiscard]] std::uint64_t given_place() const noexcept { return given_; }
  void go_to(std::uint64_t place);

  /// What was read is kept from here on, until another place is told. Precondition: not before the one told last.
  void keep_from(std::uint64_t place) noexcept { kept_ = place; }
  /// What is kept holds the damage behind it in memory: after so much of it without an event look_for() gives up.
  static constexpr std::uint64_t kDamageMostBytes = std::uint64_t{8} << 20U;
  enum class Next : std::uint8_t { kEvent, kEnd, kFar };
  /// As next(); kFar where it gave up: let go of what is kept, and call again.
  [[nodiscard]] Next look_for(LogEventView& event);
  /// An event that was given, and is kept; stays where it is until the next call of next() or look_for().
  [[nodiscard]] LogEventView event_at(std::uint64_t place) const noexcept;

  /// Bytes in the midst of the file that belong to no whole record.
  [[nodiscard]] std::uint64_t bytes_skipped() const noexcept { return bytes_skipped_; }
  /// Bytes of the record that the end of the file cuts off; 0 for a complete log. Known after next() returned
  /// false.
  [[nodiscard]] std::uint64_t bytes_cut_off() const noexcept { return bytes_cut_off_; }

 private:
  static constexpr std::uint64_t kNothingKept = std::numeric_limits<std::uint64_t>::max();
  enum class Look : std::uint8_t { kRecord, kNoRecord, kCutOff };

  explicit EventLogReader(std::ifstream file) : file_(std::move(file)) {}
  /// Whether a record lies whole in the buffer, and another one follows.
  [[nodiscard]] bool is_sure_record() const noexcept;
  bool ensure(std::size_t n);
  Look look_at(std::size_t position, std::size_t& length);
  bool may_begin_record(std::size_t position);
  std::optional<std::size_t> next_sure_record(std::size_t position, std::size_t limit);
  [[nodiscard]] std::size_t next_sync(std::size_t position);
  void read_block();
  /// What lies `position` bytes after the last one consumed. Precondition: read.
  [[nodiscard]] const std::uint8_t* at(std::size_t position) const noexcept {
    return buffer_.data() + begin_ + position;
  }
  /// Read and not yet consumed.
  [[nodiscard]] std::size_t available() const noexcept { return end_ - begin_; }
  void take(LogEventView& event);

  std::ifstream file_;
  std::vector<std::uint8_t> buffer_;  // room; what is read and not yet consumed is [begin_, end_) of it
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t read_ = 0;         // of the file
  std::uint64_t given_ = 0;        ///< place of the event that was given last
  std::uint64_t looked_from_ = 0;  ///< behind the event that was given last, or where look_for() gave up
  std::uint64_t kept_ = kNothingKept;
  std::function<void(std::uint64_t)> on_read_;
  std::uint64_t bytes_skipped_ = 0;
  std::uint64_t bytes_cut_off_ = 0;
};

/// What the first bytes of a file that is not an event log look like, in words: "text that begins with ...".
[[nodiscard]] std::string describe_bytes(const std::vector<std::uint8_t>& first_bytes);

}  // namespace imuscope
