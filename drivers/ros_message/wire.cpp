#include "drivers/ros_message/wire.h"

#include <algorithm>
#include <bit>

#include "base/bytes.h"
#include "logs/mcap/records.h"

namespace imuscope::ros_message {

std::size_t value_count(Kind kind) noexcept {
  switch (kind) {
    case Kind::kImu:
      return 6;
    case Kind::kGnss:
      return kValuesMost;
    case Kind::kSpeed:
      return 1;
    case Kind::kTimeReference:
      return 2;
  }
  return 0;
}

std::size_t write_frame(const Content& content, std::span<std::uint8_t> out) noexcept {
  std::copy(kMark.begin(), kMark.end(), out.begin());
  out[4] = static_cast<std::uint8_t>(content.kind);
  out[5] = content.flags;
  write_le(std::uint16_t{0}, out, 6);
  write_le(static_cast<std::uint64_t>(content.time_ns), out, 8);
  std::size_t at = kHeadBytes;
  for (std::size_t i = 0; i < value_count(content.kind); ++i, at += sizeof(double))
    write_le(std::bit_cast<std::uint64_t>(content.values[i]), out, at);
  write_le(mcap::crc32_of(out.first(at)), out, at);
  return at + kChecksumBytes;
}

Content read_frame(std::span<const std::uint8_t> frame) noexcept {
  Content content;
  content.kind = static_cast<Kind>(frame[4]);
  content.flags = frame[5];
  content.time_ns = read_le<std::int64_t>(frame, 8);
  for (std::size_t i = 0; i < value_count(content.kind); ++i)
    content.values[i] = read_le<double>(frame, kHeadBytes + i * sizeof(double));
  return content;
}

}  // namespace imuscope::ros_message
