#pragma once

/// Frames of identifiers that a decoder listens to, with any content and any distance in time: what damaged
/// bytes would hardly ever make.

#include <algorithm>
#include <array>
#include <chrono>

#include "drivers/device/can_decoder.h"
#include "tests/fuzz/fuzz.h"

namespace imuscope::fuzz {

/// Each frame is made of three bytes (identifier, length, milliseconds since the one before) and its data.
inline void decode_frames(CanDecoder& decoder, std::span<const std::uint8_t> stream) {
  const auto ids = decoder.ids();
  require(!ids.empty(), "a decoder says what it understands");
  CheckedSink sink;
  HostTime now = host_time_from_ns(1'000'000'000);
  std::uint64_t frames = 0;
  constexpr std::size_t kHead = 3;
  while (stream.size() >= kHead) {
    CanFrame frame;
    const CanId& id = ids[stream[0] % ids.size()];
    frame.id = id.id;
    frame.is_extended = id.is_extended;
    constexpr std::uint8_t kClassicLengths = 9;
    frame.length = stream[1] % kClassicLengths;
    now += std::chrono::milliseconds(stream[2]);
    frame.stamp = now;
    stream = stream.subspan(kHead);
    std::copy_n(stream.begin(), std::min<std::size_t>(frame.length, stream.size()), frame.data.begin());
    stream = stream.subspan(std::min<std::size_t>(frame.length, stream.size()));
    std::array<std::uint8_t, kCanRecordMaxBytes> record{};
    decoder.push(std::span(record).first(write_can_record(frame, record)), now, sink);
    ++frames;
  }
  decoder.finish(now, sink);
  require(decoder.counters().frames <= frames, "no frame is counted twice");
  require(decoder.counters().samples == sink.samples, "samples are counted as they are handed on");
  require(decoder.remark().size() < 1024, "a remark is a sentence");
}

}  // namespace imuscope::fuzz
