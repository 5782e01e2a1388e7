#pragma once

/// GNSS receivers that send NMEA 0183: the sentences of an epoch to one kGnss sample.
///
/// The sentences of an epoch share the time field; those without one (VTG) belong to the epoch around them.
/// An epoch ends with the sentence that was the last one of the epoch before, or when the time changes.
///
/// - Position and solution from GGA. The height above the ellipsoid is MSL height plus geoid separation;
///   where the receiver leaves the separation out, the configured one is taken, and without one the position
///   is not valid.
/// - Velocity from RMC, or VTG: horizontal only. The downward part is 0 with a standard deviation that says
///   so. Receivers leave the course out at standstill: then the velocity is zero below 0.3 m/s, else not
///   valid.
/// - Standard deviations of the position from GST.
/// - Date from RMC or ZDA, carried on through midnight.

#include <cstdint>
#include <optional>

#include "drivers/device/device.h"
#include "drivers/nmea/messages.h"
#include "drivers/nmea/scanner.h"
#include "sample/clock_map.h"

namespace imuscope::nmea {

/// What the decoder must know of receiver and line, and what stands in for numbers that NMEA does not carry.
struct DecoderConfig {
  DeviceIndex device = 0;
  /// Time between epochs, to tell missing ones; zero: not looked for.
  Duration period{};
  /// Time of one byte on the serial line, see byte_time(); zero over a network.
  Duration per_byte{};
  /// For receivers that give no geoid separation, m.
  std::optional<double> geoid_separation_m;
  /// Of the horizontal velocity, which NMEA gives without one.
  double horizontal_velocity_sd_mps = 0.1;
  /// Of the vertical velocity, which NMEA does not give: how fast a road vehicle climbs.
  double vertical_velocity_sd_mps = 2.0;
  /// Sentences without checksum are legal in old receivers; they prove nothing.
  bool checksum_required = true;
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

 private:
  enum class Type : std::uint8_t { kNone, kGga, kRmc, kVtg, kGst, kZda };
  struct Course {
    std::optional<double> sog_kn;
    std::optional<double> cog_deg;
  };
  struct Position {
    int quality;
    std::optional<double> lat_deg;
    std::optional<double> lon_deg;
    std::optional<double> alt_msl_m;
    std::optional<double> geoid_sep_m;
  };
  struct PositionSd {
    std::optional<double> lat_m;
    std::optional<double> lon_m;
    std::optional<double> alt_m;
  };
  struct Epoch {
    bool open = false;
    bool published = false;
    std::int64_t tod_ns = 0;
    HostTime first_byte{};
    std::uint64_t bytes = 0;
    Type last = Type::kNone;
    std::optional<Position> position;
    std::optional<Course> rmc;
    std::optional<Course> vtg;
    std::optional<PositionSd> sd;
    std::optional<Date> date;
  };

  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  void on_sentence(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] static Type type_of(std::string_view name) noexcept;
  void take(Type type, const Fields& fields) noexcept;
  void publish(HostTime arrival, SampleSink& sink) noexcept;
  void unwrap_time() noexcept;
  void update_date() noexcept;
  void fill_position(GnssData& gnss) noexcept;
  void fill_velocity(GnssData& gnss) const noexcept;
  void mirror_counts() noexcept;

  DecoderConfig config_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::uint64_t sequence_ = 0;
  Epoch epoch_;
  Type last_of_epoch_ = Type::kNone;

  bool has_time_ = false;
  std::int64_t last_tod_ns_ = 0;
  std::int64_t time_ns_ = 0;  ///< time of day, unwrapped through midnight
  std::optional<std::int64_t> since_1970_minus_time_ns_;
  bool separation_is_missing_ = false;
};

}  // namespace imuscope::nmea
