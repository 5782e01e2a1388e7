#pragma once

/// iXblue / Exail inertial units (Airins, Phins, ...) that send StdBin V2 to V5: telegrams to samples.
///
/// A telegram gives up to two samples, both at its validity time:
/// - kImu from the raw acceleration (nav bit 28) and the raw rotation rate (extended bit 2), with the
///   rotation acceleration (extended bit 0) where it is sent. Only these blocks hold what a strapdown needs:
///   gravity and Earth rate included. Units with export limits send them frozen or zero: such a telegram
///   gives no kImu sample, and raw_blocks() says why.
/// - kAttitude from heading, roll, pitch (nav bit 0) with their sd (bit 1). The heading is valid only where
///   the user status (bit 17) is sent and its alignment bit is clear.
///
/// Validity is time of day in 100 us; it is unwrapped through midnight. UTC needs the date block (bit 13),
/// and, where the user status is sent, its "time received" bit: an unsynchronised unit counts from its
/// power-up.

#include <array>
#include <cstdint>
#include <optional>

#include "drivers/device/device.h"
#include "drivers/ixblue_stdbin/messages.h"
#include "drivers/ixblue_stdbin/scanner.h"
#include "sample/clock_map.h"

namespace imuscope::ixblue_stdbin {

/// What the decoder must know of the unit's installation and its line; which blocks come, each telegram says
/// itself.
struct DecoderConfig {
  DeviceIndex device = 0;
  /// Row-major rotation that takes the unit's XV axes (forward, port, up) to b (forward, right, down).
  std::array<double, 9> axes{1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0};
  /// Time of one byte on the serial line, see byte_time(); zero over a network.
  Duration per_byte{};
  ClockMapConfig clock{};
};

/// What the raw blocks, the strapdown's input, look like.
enum class RawBlocks : std::uint8_t {
  kUnknown,  ///< no telegram yet
  kGood,
  kMissing,  ///< not in the telegrams: bits 28 and extended 2 are to be switched on in the unit
  kFrozen,   ///< the same bits again and again
  kZero,     ///< all zero: export-limited unit, or a simulation
};

/// One sentence with the remedy, empty for kGood and kUnknown.
[[nodiscard]] std::string_view describe(RawBlocks state) noexcept;

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept;

  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }

  [[nodiscard]] std::string_view remark() const noexcept override { return describe(raw_blocks_); }

  [[nodiscard]] RawBlocks raw_blocks() const noexcept { return raw_blocks_; }
  /// Telegrams whose raw blocks were zero or frozen, so that they gave no kImu sample.
  [[nodiscard]] std::uint64_t raw_blocks_refused() const noexcept { return raw_blocks_refused_; }
  /// Of the last telegram that carried it.
  [[nodiscard]] std::optional<std::uint32_t> user_status() const noexcept { return user_status_; }
  [[nodiscard]] bool aligning() const noexcept {
    return user_status_.has_value() && (*user_status_ & kUserAlignment) != 0;
  }
  [[nodiscard]] const ClockMap& clock() const noexcept { return clock_; }
  void set_per_byte(Duration per_byte) noexcept override { scanner_.set_per_byte(per_byte); }
  [[nodiscard]] Duration per_byte() const noexcept override { return scanner_.per_byte(); }
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }

 private:
  /// A raw block that stays the same to the last bit.
  struct RepeatedBlock {
    static constexpr std::size_t kSize = 3 * sizeof(float);
    std::array<std::uint8_t, kSize> last{};
    std::uint64_t in_a_row = 0;
    RawBlocks take(std::span<const std::uint8_t> block) noexcept;
  };

  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  void on_telegram(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] bool unwrap_counter(std::uint32_t counter) noexcept;
  void unwrap_validity(std::uint32_t ticks) noexcept;
  void update_utc(const Telegram& telegram) noexcept;
  void emit_imu(const Telegram& telegram, Sample& sample, SampleSink& sink) noexcept;
  void emit_attitude(const Telegram& telegram, Sample& sample, SampleSink& sink) noexcept;
  void emit(Sample& sample, SampleSink& sink) noexcept;
  [[nodiscard]] Vector3 to_b(std::span<const std::uint8_t> block, double unit) const noexcept;
  void restart_segment() noexcept;
  void mirror_scan_counters() noexcept;

  DecoderConfig config_;
  bool is_turned_;  ///< b is not the unit's forward-right-down
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::uint64_t bad_messages_ = 0;
  std::uint64_t sequence_ = 0;

  bool in_segment_ = false;
  std::uint64_t restarts_ = 0;  ///< segments begun because the counter was not continuable
  std::uint32_t last_counter_ = 0;
  int stragglers_ = 0;               ///< telegrams in a row that came twice or out of order
  std::int64_t counter_ = 0;         ///< unwrapped
  std::uint32_t last_validity_ = 0;  ///< ticks of the day
  std::int64_t ticks_ = 0;           ///< unwrapped
  std::optional<std::int64_t> last_imu_counter_;
  bool gap_before_imu_ = false;

  bool has_utc_ = false;
  std::int64_t utc_ticks_ = 0;     ///< since 1970, of the last telegram with a date
  std::int64_t utc_at_ticks_ = 0;  ///< unwrapped validity that utc_ticks_ belongs to

  RawBlocks raw_blocks_ = RawBlocks::kUnknown;
  std::uint64_t raw_blocks_refused_ = 0;
  RepeatedBlock rate_;
  RepeatedBlock acceleration_;
  std::optional<std::uint32_t> user_status_;
};

}  // namespace imuscope::ixblue_stdbin
