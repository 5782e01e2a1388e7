#pragma once

/// Solutions of RTKLIB to kGnss samples: from a .pos file, or as rtkrcv and str2str send them over TCP.
///
/// LLH, XYZ and ENU; ENU needs the base, from the "ref pos" comment or the configuration. Standard deviations
/// are rotated to north-east-down with their cross terms. Where the header names columns of velocity they are
/// used. Device time is the line's own time, nanoseconds since 1970.

#include <array>
#include <cstdint>
#include <optional>

#include "drivers/device/device.h"
#include "drivers/device/frame_buffer.h"
#include "drivers/rtklib_pos/messages.h"
#include "sample/clock_map.h"

namespace imuscope::rtklib_pos {

inline constexpr std::size_t kLineMax = 1024;

struct DecoderConfig {
  DeviceIndex device = 0;
  /// Time between solutions, to tell missing ones; zero: not looked for.
  Duration period{};
  /// What lines hold until a header says so: a client that connects late gets none.
  Format format{};
  std::optional<ReferencePosition> base;
  ClockMapConfig clock{};
};

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept;

  void push(std::span<const std::uint8_t> bytes, HostTime arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }

  [[nodiscard]] const Format& format() const noexcept { return format_; }
  /// Solutions east-north-up came and the place of the base is not known.
  [[nodiscard]] bool base_is_missing() const noexcept { return base_is_missing_; }

 private:
  [[nodiscard]] bool take_line(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  [[nodiscard]] bool on_solution(const Solution& solution, HostTime first_byte, HostTime arrival,
                                 SampleSink& sink) noexcept;
  [[nodiscard]] bool fill(const Solution& solution, GnssData& gnss) noexcept;

  DecoderConfig config_;
  FrameBuffer<2 * kLineMax> buffer_;
  ClockMap clock_;
  DecoderCounters counters_;
  Format format_;
  std::optional<ReferencePosition> base_;
  bool base_is_missing_ = false;
  bool skipping_long_line_ = false;
  std::uint64_t sequence_ = 0;
  std::optional<std::int64_t> last_time_ns_;
};

}  // namespace imuscope::rtklib_pos
