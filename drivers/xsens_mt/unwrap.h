#pragma once

/// A device's wrapping count made 64 bits wide. The count alone cannot tell a restart from a gap, nor how
/// often it wrapped in a long silence: host time decides. A count that arrives ahead of host time cannot be
/// true (delay is never negative): it is a damaged value, or the device restarted; the next one tells which.

#include <cstdint>

#include "base/time.h"

namespace imuscope::xsens {

enum class CountStep : std::uint8_t {
  kFirst,
  kForward,    ///< continues; step() counts further than before
  kRepeated,   ///< the same count again
  kRestarted,  ///< a new segment: counts on after the last one, what lies between is not known
  kRejected,   ///< not to be believed; nothing was taken over
};

/// How the count runs: where it wraps and how fast. Moduli that differ between devices (SampleTimeFine wraps
/// at 2^32 or after one day) may both be given.
struct UnwrapConfig {
  std::int64_t modulus = 0;
  std::int64_t other_modulus = 0;  ///< second possible place of the wrap; 0: none
  double counts_per_s = 0.0;
  bool host_time_is_meaningful = true;  ///< false for recordings without arrival stamps
};

/// Unwraps the counts of one device, handed in as they arrive. Core: no allocation, noexcept. Thread: owner
/// only.
class CountUnwrapper {
 public:
  explicit CountUnwrapper(const UnwrapConfig& config) noexcept;

  /// @param raw      count as sent, below the modulus
  /// @param arrival  host time of the frame
  CountStep take(std::int64_t raw, HostTime arrival) noexcept;

  /// The count, unwrapped; continues across restarts by one.
  [[nodiscard]] std::int64_t count() const noexcept { return count_; }
  /// Counts since the count before; meaningful after kForward.
  [[nodiscard]] std::int64_t step() const noexcept { return step_; }

  void set_rate(double counts_per_s) noexcept {
    config_.counts_per_s = counts_per_s;
    s_per_count_ = 1.0 / counts_per_s;
  }

 private:
  [[nodiscard]] std::int64_t smallest_step(std::int64_t raw) const noexcept;
  [[nodiscard]] CountStep suspect(std::int64_t raw, HostTime arrival) noexcept;
  void accept(std::int64_t raw, HostTime arrival, std::int64_t step) noexcept;

  UnwrapConfig config_;
  double s_per_count_;
  bool has_last_ = false;
  std::int64_t raw_ = 0;
  std::int64_t count_ = 0;
  std::int64_t step_ = 0;
  HostTime arrival_{};
  double behind_s_ = 0.0;  ///< how late the stream is against its promptest recent frame
  bool suspected_ = false;
  std::int64_t suspect_raw_ = 0;
};

}  // namespace imuscope::xsens
