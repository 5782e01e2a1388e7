#pragma once

/// What the protocols of `imuscope decode` share.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>

#include "base/time.h"
#include "stream_protocols.h"

namespace imuscope::cli {

/// @param told  the position that was told last
inline void tell_position(const Visitor& visitor, std::uint64_t offset, std::uint64_t& told) {
  if (offset < told + kPositionStep) return;
  told = offset;
  visitor.position(offset);
}

/// Calls back for each frame of a whole stream.
template <typename Scanner, typename Frame, typename OnFrame>
void scan_whole(std::span<const std::uint8_t> stream, const Visitor& visitor, OnFrame&& on_frame) {
  Scanner scanner;
  Frame frame;
  const std::size_t size = stream.size();
  std::uint64_t told = 0;
  while (!stream.empty()) {
    stream = stream.subspan(scanner.append(stream, HostTime{}));
    while (scanner.next(frame)) on_frame(frame);
    tell_position(visitor, size - stream.size(), told);
  }
  while (scanner.next(frame, true)) on_frame(frame);
}

/// Where the line that begins at `at` ends; a line longer than any message is taken in pieces of that length.
inline std::size_t line_end(std::string_view text, std::size_t at, std::string_view ends) {
  constexpr std::size_t kLongestLine = 4096;
  const std::string_view window = text.substr(at, kLongestLine);
  return at + std::min(window.find_first_of(ends), window.size());
}

/// `end`, after the CR and LF that stand there: they end the line, and belong to nobody else.
inline std::uint64_t behind_line_end(std::span<const std::uint8_t> stream, std::uint64_t end) {
  while (end < stream.size() && (stream[end] == '\r' || stream[end] == '\n')) ++end;
  return end;
}

/// Null for what is no number.
inline nlohmann::ordered_json json_number(double value, bool is_integer) {
  if (!std::isfinite(value)) return nullptr;
  if (is_integer) return static_cast<std::int64_t>(value);
  return value;
}

}  // namespace imuscope::cli
