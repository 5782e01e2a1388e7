#pragma once

/// Javad / Topcon receivers that send GREIS: the messages of an epoch to one kGnss sample.
///
/// An epoch runs from [~~] (RT) to [::] (ET) with the same time; where the stream has no ET, to the next RT.
/// An epoch in which bytes were lost gives no sample. Position from [PG], else [PO] or [PV]; velocity from
/// [VG], else [VE] or [PV]; standard deviations from [SG] (its horizontal values are those of the plane: each
/// of north and east gets 1/sqrt(2) of it), else from the position's and velocity's own sigma. The time of
/// validity is that of [ST] where it is sent, as in delayed RTK the position is one of the past, plus the
/// clock offset [TO].
///
/// UTC: [RD] gives date and time base, and is carried on through midnight; without it [GT] does. GPS time
/// minus UTC is 18 s until [UO] says otherwise.

#include <cstdint>
#include <optional>

#include "drivers/device/device.h"
#include "drivers/greis/messages.h"
#include "drivers/greis/scanner.h"
#include "sample/clock_map.h"

namespace imuscope::greis {

/// What the decoder is told of receiver and line; the messages themselves and the time base are found in the
/// stream.
struct DecoderConfig {
  DeviceIndex device = 0;
  /// Time between epochs, to tell missing ones; zero: not looked for.
  Duration period = std::chrono::milliseconds(100);
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

  /// Epochs begun, and those of them that gave no sample because something in them was lost.
  [[nodiscard]] std::uint64_t epochs() const noexcept { return epochs_; }
  [[nodiscard]] std::uint64_t epochs_damaged() const noexcept { return epochs_damaged_; }
  [[nodiscard]] const ClockMap& clock() const noexcept { return clock_; }
  void set_per_byte(Duration per_byte) noexcept override { scanner_.set_per_byte(per_byte); }
  [[nodiscard]] Duration per_byte() const noexcept override { return scanner_.per_byte(); }
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }

 private:
  struct Epoch {
    std::uint32_t tod_ms = 0;
    HostTime first_byte{};
    std::uint64_t offset = 0;  ///< of its first byte in the stream
    std::uint64_t skipped_before = 0;
    bool damaged = false;
    std::optional<ReceiverDate> date;
    std::optional<GpsTime> gps_time;
    std::optional<TimeOffset> time_offset;
    std::optional<SolutionTime> solution_time;
    std::optional<PositionGeodetic> position_geodetic;
    std::optional<PositionEcef> position_ecef;
    std::optional<VelocityGeodetic> velocity_geodetic;
    std::optional<VelocityEcef> velocity_ecef;
    std::optional<Sigmas> sigmas;
  };

  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  void on_message(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  void on_epoch_message(const Frame& frame) noexcept;
  void begin_epoch(const Frame& frame) noexcept;
  void end_epoch(bool complete, std::uint64_t end_offset, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] bool unwrap_time(std::uint32_t tod_ms) noexcept;
  void update_date() noexcept;
  void fill_position(GnssData& gnss) const noexcept;
  void fill_velocity(GnssData& gnss) const noexcept;
  void mirror_counts() noexcept;

  DecoderConfig config_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::uint64_t bad_messages_ = 0;
  std::uint64_t sequence_ = 0;
  std::uint64_t epochs_ = 0;
  std::uint64_t epochs_damaged_ = 0;

  bool in_epoch_ = false;
  bool stream_has_epoch_end_ = false;
  Epoch epoch_;

  bool has_time_ = false;
  std::uint32_t last_tod_ms_ = 0;
  std::int64_t time_ms_ = 0;   ///< receiver time, unwrapped through midnight
  std::optional<int> leap_s_;  ///< GPS time minus UTC as the receiver says in [UO]
  /// Milliseconds since 1970 in the receiver's time base, minus time_ms_.
  std::optional<std::int64_t> since_1970_minus_time_ms_;
  bool date_from_receiver_date_ = false;
  TimeBase base_ = TimeBase::kGps;
};

}  // namespace imuscope::greis
