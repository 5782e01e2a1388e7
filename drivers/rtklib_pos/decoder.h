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
#include "drivers/rtklib_pos/messages.h"
#include "drivers/rtklib_pos/scanner.h"
#include "sample/clock_map.h"

namespace imuscope::rtklib_pos {

/// What the decoder must know beforehand, as a stream joined late has no header. `base` stands in until a
/// "ref pos" comment names another one.
struct DecoderConfig {
  DeviceIndex device = 0;
  /// Time between solutions, to tell missing ones; zero: not looked for.
  Duration period{};
  /// What lines hold until a header says so: a client that connects late gets none.
  Format format{};
  std::optional<ReferencePosition> base;
  /// Time of one byte on the serial line, see byte_time(); zero over a network.
  Duration per_byte{};
  ClockMapConfig clock{};
};

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept;

  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }
  void set_per_byte(Duration per_byte) noexcept override { scanner_.set_per_byte(per_byte); }
  [[nodiscard]] Duration per_byte() const noexcept override { return scanner_.per_byte(); }
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }

  [[nodiscard]] std::string_view remark() const noexcept override;

  [[nodiscard]] const Format& format() const noexcept { return format_; }
  /// Solutions east-north-up came and the place of the base is not known.
  [[nodiscard]] bool base_is_missing() const noexcept { return base_is_missing_; }

 private:
  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  [[nodiscard]] bool on_solution(const Solution& solution, HostTime first_byte, HostTime arrival,
                                 SampleSink& sink) noexcept;
  [[nodiscard]] bool fill(const Solution& solution, GnssData& gnss) noexcept;

  DecoderConfig config_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  Format format_;
  std::optional<ReferencePosition> base_;
  bool base_is_missing_ = false;
  std::uint64_t bad_lines_ = 0;
  std::uint64_t bytes_of_bad_lines_ = 0;
  std::uint64_t sequence_ = 0;
  std::optional<std::int64_t> last_time_ns_;
};

}  // namespace imuscope::rtklib_pos
