#include "drivers/rtklib_pos/scanner.h"

#include <cstring>

namespace imuscope::rtklib_pos {

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  buffer_.consume(taken_);
  taken_ = 0;
  for (;;) {
    const auto pending = buffer_.pending();
    if (pending.empty()) return false;
    const auto* end = static_cast<const std::uint8_t*>(std::memchr(pending.data(), '\n', pending.size()));
    if (end == nullptr && pending.size() > kLineMax) {
      if (!in_long_line_) ++counters_.bad_lengths;
      in_long_line_ = true;
      skip(pending.size());
      continue;
    }
    if (end == nullptr && !at_end) return false;
    const std::size_t size = end == nullptr ? pending.size() : static_cast<std::size_t>(end - pending.data());
    const std::size_t with_end = end == nullptr ? size : size + 1;
    if (in_long_line_ || size > kLineMax) {
      if (!in_long_line_) ++counters_.bad_lengths;
      in_long_line_ = false;
      skip(with_end);
      continue;
    }
    const std::string_view whole(reinterpret_cast<const char*>(pending.data()), size);
    const std::size_t first = whole.find_first_not_of(" \t\r");
    if (first == std::string_view::npos) {
      buffer_.consume(with_end);
      continue;
    }
    frame = {whole.substr(first), with_end, buffer_.position(), buffer_.arrival_of(0)};
    taken_ = with_end;
    return true;
  }
}

void Scanner::skip(std::size_t n) noexcept {
  counters_.bytes_skipped += n;
  buffer_.consume(n);
}

}  // namespace imuscope::rtklib_pos
