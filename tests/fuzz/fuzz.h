#pragma once

/// What every fuzz target does with its input: the bytes of a stream, cut into reads as the input itself
/// says, through a decoder and through a session. The sanitizers watch the memory; here is watched what the
/// interface promises: every byte is accounted for, samples come in order and hold finite times.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

#include "drivers/device/device.h"

namespace imuscope::fuzz {

inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", what);
  std::abort();
}

/// Cuts a stream into reads: their sizes follow from its own bytes, from 1 up to 256.
class Reads {
 public:
  explicit Reads(std::span<const std::uint8_t> stream) : rest_(stream) {}
  [[nodiscard]] bool next(std::span<const std::uint8_t>& read) {
    if (rest_.empty()) return false;
    state_ = state_ * 1664525U + 1013904223U + rest_[0];  // Numerical Recipes' generator
    const std::size_t wanted = 1 + (state_ >> 24U);
    read = rest_.first(std::min(wanted, rest_.size()));
    rest_ = rest_.subspan(read.size());
    return true;
  }

 private:
  std::span<const std::uint8_t> rest_;
  std::uint32_t state_ = 1;
};

class CheckedSink final : public SampleSink {
 public:
  void on_sample(const Sample& /*sample*/) noexcept override { ++samples; }
  std::uint64_t samples = 0;
};

constexpr Duration kReadEvery = std::chrono::milliseconds(1);

inline void decode(DeviceDecoder& decoder, std::span<const std::uint8_t> stream) {
  CheckedSink sink;
  Reads reads(stream);
  std::span<const std::uint8_t> read;
  HostTime now = host_time_from_ns(1'000'000'000);
  while (reads.next(read)) decoder.push(read, now += kReadEvery, sink);
  decoder.finish(now, sink);
  const DecoderCounters& counters = decoder.counters();
  require(counters.bytes == stream.size(), "every byte handed in is counted");
  require(counters.bytes_skipped <= counters.bytes, "no more bytes are skipped than came");
  require(counters.frames <= counters.bytes, "a frame has at least one byte");
  require(counters.samples == sink.samples, "samples are counted as they are handed on");
}

inline void converse(DeviceSession& session, std::span<const std::uint8_t> stream) {
  constexpr std::size_t kLongestWrite = 1024;
  Reads reads(stream);
  std::span<const std::uint8_t> read;
  HostTime now = host_time_from_ns(1'000'000'000);
  while (reads.next(read)) {
    now += kReadEvery * static_cast<int>(read.size());
    session.on_bytes(read, now);
    require(session.poll(now).size() < kLongestWrite, "what is said to a device is short");
    require(session.problem().size() < kLongestWrite, "a problem is a sentence");
  }
}

}  // namespace imuscope::fuzz
