#include "drivers/xsens_can/high_rate.h"

#include <cmath>

#include "base/units.h"

namespace imuscope::xsens_can {
namespace {

/// At rest: the force is gravity's within bias and scale of any unit and place, the rate within its bias.
constexpr double kGravityTolerance_mps2 = 0.5;
constexpr double kRateAtRest_radps = 2.0 * kRadPerDeg;
/// Samples whose mean is looked at: noise and vibration are gone from it, a motion is not.
constexpr int kWindow = 50;

double norm(const std::array<std::int64_t, 3>& sum, double scale) noexcept {
  constexpr double kShare = 1.0 / kWindow;
  return scale * kShare *
         std::hypot(static_cast<double>(sum[0]), static_cast<double>(sum[1]), static_cast<double>(sum[2]));
}

bool is_rest(const std::array<std::int64_t, 3>& acceleration,
             const std::array<std::int64_t, 3>& rate) noexcept {
  return std::abs(norm(acceleration, kAcceleration_mps2) - kMps2PerG) < kGravityTolerance_mps2 &&
         norm(rate, kRate_radps) < kRateAtRest_radps;
}

}  // namespace

void HighRateResolver::add(const RawTriad& first, const RawTriad& second) noexcept {
  if (order_ != HighRateOrder::kUnknown) return;
  for (std::size_t i = 0; i < first.size(); ++i) {
    first_[i] += first[i];
    second_[i] += second[i];
  }
  if (++n_ < kWindow) return;
  if (is_rest(first_, second_)) {
    order_ = HighRateOrder::kAccelerationFirst;
  } else if (is_rest(second_, first_)) {
    order_ = HighRateOrder::kRateFirst;
  }
  first_ = second_ = {};
  n_ = 0;
}

}  // namespace imuscope::xsens_can
