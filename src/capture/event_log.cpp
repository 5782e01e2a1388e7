#include "capture/event_log.h"

#include <type_traits>

namespace imuscope {
namespace {

template <typename Integer>
void put_big_endian(std::vector<std::uint8_t>& out, Integer value) {
  const auto bits = static_cast<std::make_unsigned_t<Integer>>(value);
  for (unsigned shift = sizeof(Integer) * 8; shift > 0; shift -= 8) {
    out.push_back(static_cast<std::uint8_t>(bits >> (shift - 8)));
  }
}

}  // namespace

void append_record_head(std::vector<std::uint8_t>& out, std::int64_t number, std::int64_t utime,
                        std::string_view channel, std::size_t data_bytes) {
  put_big_endian(out, kEventLogSync);
  put_big_endian(out, number);
  put_big_endian(out, utime);
  put_big_endian(out, static_cast<std::int32_t>(channel.size()));
  put_big_endian(out, static_cast<std::int32_t>(data_bytes));
  out.insert(out.end(), channel.begin(), channel.end());
}

}  // namespace imuscope
