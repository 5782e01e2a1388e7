#pragma once

/// Which of the two high-rate messages is the acceleration: documents contradict one another, so the sensor
/// is asked at rest, where one shows gravity and the other nothing. Core: no allocation.

#include <array>
#include <cstdint>

#include "drivers/xsens_can/messages.h"

namespace imuscope::xsens_can {

enum class HighRateOrder : std::uint8_t {
  kUnknown,            ///< it has not rested yet
  kAccelerationFirst,  ///< 061 is the acceleration
  kRateFirst,
};

/// Averages blocks of 50 samples of both messages until one block shows a rest; what it says then, it keeps.
class HighRateResolver {
 public:
  /// One sample of both messages.
  void add(const RawTriad& first, const RawTriad& second) noexcept;
  [[nodiscard]] HighRateOrder order() const noexcept { return order_; }

 private:
  HighRateOrder order_ = HighRateOrder::kUnknown;
  std::array<std::int64_t, 3> first_{};  ///< sums over the samples of a window
  std::array<std::int64_t, 3> second_{};
  int n_ = 0;
};

}  // namespace imuscope::xsens_can
