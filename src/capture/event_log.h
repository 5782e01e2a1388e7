#pragma once

/// The LCM event log as a file format: records of
///   uint32 0xEDA1DA01, int64 number, int64 utime, int32 channel length, int32 data length, channel, data,
/// big-endian, one after another, without a file header. (LCM documentation, "LCM log file format".)

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace imuscope {

inline constexpr std::uint32_t kEventLogSync = 0xEDA1'DA01;
inline constexpr std::size_t kEventLogHeaderBytes = 28;
/// Larger lengths in a record are taken for corruption. LCM itself limits neither.
inline constexpr std::size_t kMaxEventChannelBytes = 1000;
inline constexpr std::size_t kMaxEventDataBytes = std::size_t{64} << 20U;

/// One record: its running number, its time in microseconds since 1970 (UTC) by the writer's clock, and an
/// encoded LCM message with the channel it was sent on.
struct LogEvent {
  std::int64_t number = 0;
  std::int64_t utime = 0;
  std::string channel;
  std::vector<std::uint8_t> data;
};

/// The same in somebody else's memory, which says how long it stays there.
struct LogEventView {
  std::int64_t number = 0;
  std::int64_t utime = 0;
  std::string_view channel;
  std::span<const std::uint8_t> data;

  LogEventView() = default;
  LogEventView(const LogEvent& event)  // NOLINT(google-explicit-constructor): as a string is a string_view
      : number(event.number), utime(event.utime), channel(event.channel), data(event.data) {}
  void copy_to(LogEvent& event) const;
};

/// The next event of a reader that gives views, as a copy; false at the end.
template <typename Reader>
[[nodiscard]] bool copy_next(Reader& reader, LogEvent& event) {
  LogEventView view;
  if (!reader.next(view)) return false;
  view.copy_to(event);
  return true;
}

/// What a record begins with, up to its channel.
using EventLogHeader = std::array<std::uint8_t, kEventLogHeaderBytes>;
[[nodiscard]] EventLogHeader event_log_header(std::int64_t number, std::int64_t utime,
                                              std::size_t channel_bytes, std::size_t data_bytes) noexcept;

/// Appends what a record has before its data.
void append_record_head(std::vector<std::uint8_t>& out, std::int64_t number, std::int64_t utime,
                        std::string_view channel, std::size_t data_bytes);

}  // namespace imuscope
