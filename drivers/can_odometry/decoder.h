#pragma once

/// Wheel speeds from a vehicle's CAN to kOdometry samples: the mean of the signals that the configuration
/// chose out of the vehicle's DBC file.
///
/// The chosen signals may stand in several messages: a sample is made when all of them have come anew, and is
/// taken at the newest of their frames' stamps, less the configured latency. A signal that is not in its
/// frame (too short, another multiplex), a fault bit, a number with a name such as "not available", or an
/// impossible speed gives no sample; all are counted. Core: no allocation after construction.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "drivers/dbc/database.h"
#include "drivers/device/can_decoder.h"
#include "drivers/device/sentence.h"

namespace imuscope::can_odometry {

enum class SpeedUnit : std::uint8_t { kMps, kKmph, kMph, kRadps };

/// What a person chose; names are "MESSAGE.SIGNAL", or "SIGNAL" where it is unique.
struct Choice {
  std::vector<std::string> speed_signals;
  std::optional<SpeedUnit> unit;             ///< absent: the DBC's own unit of each signal
  double wheel_radius_m = 0.0;               ///< for signals in rad/s
  bool has_no_sign = false;                  ///< the signals are magnitudes
  std::string direction_signal;              ///< empty: none
  std::vector<std::string> backward_values;  ///< names of its values, or numbers
  std::vector<std::string> fault_signals;    ///< anything but 0 spoils the speeds
  std::vector<double> invalid_raw;           ///< numbers in the frame that are no speeds
  std::string counter_signal;                ///< counts the frames of its message; empty: none
};

/// What the decoder is told of the vehicle's odometry: how often the wheels report, how late, and what speeds
/// (m/s) and accelerations (m/s²) no vehicle exceeds.
struct DecoderConfig {
  DeviceIndex device = 0;
  double rate_hz = 50.0;
  Duration latency{};  ///< from the motion to the frame's stamp
  double max_speed_mps = 100.0;
  double max_acceleration_mps2 = 20.0;
};

/// What kept frames and sets of wheel speeds from giving a sample, since construction; beside the counters
/// that every decoder has.
struct OdometryCounters {
  std::uint64_t too_short = 0;   ///< frame has fewer bytes than a chosen signal needs
  std::uint64_t invalid = 0;     ///< fault bit, invalid number, named number
  std::uint64_t impossible = 0;  ///< faster, or changing faster, than any vehicle
  std::uint64_t incomplete = 0;  ///< sets of wheels of which one did not come in time
};

class Decoder final : public CanDecoder {
 public:
  /// Errors (kUsage): an unknown signal, with the nearest name; a unit that is not known.
  static Result<std::unique_ptr<Decoder>> make(const dbc::Database& database, const Choice& choice,
                                               const DecoderConfig& config);

  [[nodiscard]] const OdometryCounters& odometry_counters() const noexcept { return odometry_counters_; }

  [[nodiscard]] std::vector<CanId> ids() const override;

  /// What is wrong with the frames, in one sentence with the remedy; empty when all is well.
  [[nodiscard]] std::string_view remark() const noexcept override { return remark_.view(); }

 private:
  enum class Use : std::uint8_t { kSpeed, kDirection, kFault, kCounter };
  struct Signal {
    std::size_t message;  ///< index in messages_
    std::size_t signal;
    Use use;
    double to_mps = 1.0;
    std::size_t wheel = 0;              ///< kSpeed
    std::vector<std::int64_t> numbers;  ///< kSpeed: not a speed; kDirection: backward
  };
  struct Wheel {
    double speed_mps = 0.0;
    bool is_new = false;
    bool is_good = false;
    HostTime stamp{};
  };

  Decoder(const DecoderConfig& config) : config_(config) {}
  Result<void> add_speed(const dbc::Database& database, const std::string& name, const Choice& choice);
  Result<void> add_direction(const dbc::Database& database, const Choice& choice);
  Result<std::size_t> add(const dbc::Database& database, const std::string& name, Use use);
  void on_frame(const CanFrame& frame, HostTime arrival, SampleSink& sink) noexcept override;
  void on_counter(const Signal& signal, std::uint64_t raw) noexcept;
  void take_speed(const Signal& signal, std::uint64_t raw, HostTime stamp) noexcept;
  void on_short_frame(const dbc::Message& message, const CanFrame& frame) noexcept;
  void on_impossible(double speed_mps, HostTime stamp) noexcept;
  void on_invalid() noexcept;
  void emit(HostTime arrival, SampleSink& sink) noexcept;
  void count_by_time(HostTime stamp) noexcept;
  [[nodiscard]] bool is_possible(double speed_mps, HostTime stamp) noexcept;

  DecoderConfig config_;
  std::vector<dbc::Message> messages_;  ///< those that hold a chosen signal
  std::vector<Signal> signals_;
  std::vector<Wheel> wheels_;
  bool has_no_sign_ = false;
  bool backward_ = false;
  bool fault_ = false;
  OdometryCounters odometry_counters_;
  std::uint64_t sequence_ = 0;
  std::optional<std::uint64_t> last_count_;
  // Without a counter, what is missing shows in the stamps.
  std::uint64_t sets_ = 0;
  HostTime last_set_{};
  double period_s_ = 0.0;  ///< between sets, as it has been lately
  double jitter_s_ = 0.0;  ///< mean deviation from it
  bool has_last_ = false;
  double last_speed_mps_ = 0.0;
  HostTime last_stamp_{};
  int impossible_in_a_row_ = 0;
  Sentence remark_;
  HostTime remarked_{};  ///< when it was last true
  bool impossible_told_ = false;
};

}  // namespace imuscope::can_odometry
