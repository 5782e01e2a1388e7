#pragma once

/// What the protocols of `imuscope decode` share.

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>

#include "base/time.h"

namespace imuscope::cli {

/// Calls back for each frame of a whole stream.
template <typename Scanner, typename Frame, typename OnFrame>
void scan_whole(std::span<const std::uint8_t> stream, OnFrame&& on_frame) {
  Scanner scanner;
  Frame frame;
  while (!stream.empty()) {
    stream = stream.subspan(scanner.append(stream, HostTime{}));
    while (scanner.next(frame)) on_frame(frame);
  }
  while (scanner.next(frame, true)) on_frame(frame);
}

/// `end`, behind the CR and LF that stand there: they end the line, and belong to nobody else.
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
