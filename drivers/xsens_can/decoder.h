#pragma once

/// Samples out of the CAN output of an XSens MTi-600. SampleTime and GroupCounter open a group; it is closed
/// by the next one that opens, never by a count of frames, so a sample comes one period after its instant.
///
/// Rates and forces are taken from the increments (delta_q, delta_v) where both are sent: the rate of turn
/// has steps of 0.11 deg/s. Then from rate_of_turn and acceleration, then from the two high-rate messages,
/// averaged over the group, once a rest has shown which is which. Core: no allocation after construction.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/device/can_decoder.h"
#include "drivers/xsens_can/high_rate.h"
#include "drivers/xsens_can/messages.h"
#include "drivers/xsens_mt/unwrap.h"
#include "sample/clock_map.h"

namespace imuscope::xsens_can {

/// How the device was set up: its rate and the identifiers of its messages cannot be read off the bus.
struct DecoderConfig {
  DeviceIndex device = 0;
  double rate_hz = 100.0;  ///< of the groups
  ItemIds ids = default_ids();
  std::array<double, 9> axes{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rotates the sensor's components, row-major
  ClockMapConfig clock;
};

/// What the samples are made of, the best last.
enum class Source : std::uint8_t { kNone, kHighRate, kRates, kIncrements };

class Decoder final : public CanDecoder {
 public:
  explicit Decoder(const DecoderConfig& config);

  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }
  [[nodiscard]] std::vector<CanId> ids() const override { return {config_.ids.begin(), config_.ids.end()}; }

  [[nodiscard]] Source source() const noexcept { return source_; }
  /// Length of one tick of SampleTime, which documents do not agree on; 0 until it is known.
  [[nodiscard]] std::int64_t tick_ns() const noexcept { return tick_ns_; }
  [[nodiscard]] HighRateOrder high_rate_order() const noexcept { return high_rate_.order(); }

  /// What is wrong, in one sentence with the remedy; empty when all is well.
  [[nodiscard]] std::string_view remark() const noexcept override;

 private:
  /// Mean of the high-rate frames of a group.
  struct Mean {
    std::array<std::int64_t, 3> sum{};
    int n = 0;
  };
  struct Group {
    bool is_open = false;
    bool has_data = false;
    HostTime stamp{};  ///< of its first frame
    std::optional<std::uint32_t> sample_time;
    std::optional<std::uint16_t> counter;
    std::optional<std::uint32_t> status_word;
    std::optional<Triad> delta_v;
    std::optional<std::array<double, 4>> delta_q;
    std::optional<Triad> rate;
    std::optional<Triad> acceleration;
    std::array<Mean, 2> high_rate;
  };
  /// Unwrapped count and time of a group.
  struct Instant {
    std::int64_t counter = 0;
    std::int64_t time_ns = 0;
    double dt_s = 0.0;  ///< of the increments
  };

  void on_frame(const CanFrame& frame, HostTime arrival, SampleSink& sink) noexcept override;
  void open(HostTime stamp) noexcept;
  [[nodiscard]] bool is_repeated(Item item, std::span<const std::uint8_t> data) const noexcept;
  [[nodiscard]] bool take(Item item, std::span<const std::uint8_t> data) noexcept;
  void close(HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] bool locate(Instant& at) noexcept;
  [[nodiscard]] bool settle_tick(std::uint32_t raw, std::int64_t groups) noexcept;
  void restart() noexcept;
  [[nodiscard]] Source best_source() const noexcept;
  [[nodiscard]] bool choose_source() noexcept;
  [[nodiscard]] bool fill(const Instant& at, ImuData& imu) noexcept;
  [[nodiscard]] bool fill_high_rate(ImuData& imu) const noexcept;
  [[nodiscard]] Vector3 rotated(const Triad& v) const noexcept;

  DecoderConfig config_;
  ClockMap clock_;
  Group group_;
  HighRateResolver high_rate_;
  xsens::CountUnwrapper counter_;
  std::optional<xsens::CountUnwrapper> sample_time_;
  std::int64_t tick_ns_ = 0;
  std::optional<std::uint32_t> last_raw_time_;
  std::optional<std::uint16_t> last_raw_counter_;
  std::uint64_t restarts_ = 0;  ///< segments begun because count or time were not continuable
  bool has_last_ = false;
  std::int64_t last_counter_ = 0;
  std::int64_t last_time_ns_ = 0;
  bool gap_pending_ = false;
  Source source_ = Source::kNone;
  int lacking_ = 0;  ///< groups in a row without what the samples are made of
  std::uint64_t overflows_ = 0;
  std::uint64_t untimed_ =
      0;  ///< data frames that came while no SampleTime or GroupCounter had opened a group
  std::uint64_t sequence_ = 0;
};

}  // namespace imuscope::xsens_can
