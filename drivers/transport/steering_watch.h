#pragma once

/// Notices how the PC steers its clock: CLOCK_MONOTONIC beside CLOCK_MONOTONIC_RAW, the same quartz left
/// alone. Tells where the line of the one over the other bends, and nothing as long as what was told holds.

#include <array>
#include <cstddef>
#include <optional>

#include "drivers/device/pulse_record.h"

namespace imuscope {

/// One reading of both clocks. The best of a few tries. Core: no allocation.
[[nodiscard]] ClockSteering read_quartz() noexcept;

/// Deterministic: a function of the readings. Core: no allocation.
class SteeringWatch {
 public:
  /// @param reading  its rate is of no concern
  /// @return the line from here on, with its rate as it is recorded, where what was told before does not hold
  [[nodiscard]] std::optional<ClockSteering> look(const ClockSteering& reading) noexcept;

 private:
  /// A second's: a bend by 1 ppm shows within it.
  static constexpr std::size_t kPast = 64;

  [[nodiscard]] const ClockSteering& past(std::size_t back) const noexcept;
  [[nodiscard]] Duration mean_beside(const ClockSteering& line) const noexcept;
  [[nodiscard]] std::optional<std::size_t> find_bend(const ClockSteering& reading) const noexcept;

  std::array<ClockSteering, kPast> readings_{};
  std::size_t n_ = 0;        ///< readings so far
  std::size_t on_line_ = 0;  ///< of them since the present line began
  ClockSteering bend_;       ///< where it began
  ClockSteering told_;
  bool has_told_ = false;
};

}  // namespace imuscope
