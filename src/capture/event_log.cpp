#include "capture/event_log.h"

#include <type_traits>

namespace imuscope {
namespace {

/// Writes it at `at`, and returns where it ends.
template <typename Integer>
std::uint8_t* put_big_endian(std::uint8_t* at, Integer value) noexcept {
  const auto bits = static_cast<std::make_unsigned_t<Integer>>(value);
  for (unsigned shift = sizeof(Integer) * 8; shift > 0; shift -= 8)
    *at++ = static_cast<std::uint8_t>(bits >> (shift - 8));
  return at;
}

}  // namespace

void LogEventView::copy_to(LogEvent& event) const {
  event.number = number;
  event.utime = utime;
  event.channel.assign(channel);
  event.data.assign(data.begin(), data.end());
}

EventLogHeader event_log_header(std::int64_t number, std::int64_t utime, std::size_t channel_bytes,
                                std::size_t data_bytes) noexcept {
  EventLogHeader header{};
  std::uint8_t* at = header.data();
  at = put_big_endian(at, kEventLogSync);
  at = put_big_endian(at, number);
  at = put_big_endian(at, utime);
  at = put_big_endian(at, static_cast<std::int32_t>(channel_bytes));
  put_big_endian(at, static_cast<std::int32_t>(data_bytes));
  return header;
}

void append_record_head(std::vector<std::uint8_t>& out, std::int64_t number, std::int64_t utime,
                        std::string_view channel, std::size_t data_bytes) {
  const auto header = event_log_header(number, utime, channel.size(), data_bytes);
  out.insert(out.end(), header.begin(), header.end());
  out.insert(out.end(), channel.begin(), channel.end());
}

}  // namespace imuscope
