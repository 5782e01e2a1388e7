#include "drivers/xsens_can/high_rate.h"

#include <cmath>

#include "base/units.h"

namespace imuscope::xsens_can {
namespace {

/// At rest: the force is gravity's within bias and scale of any unit and place, the rate within its bias.
constexpr double kGravityTolerance_mps2 = 0.5;
constexpr double kRateAtRest_radps = 2.0 * kRadPerDeg;
/// Samples in a row that have to agree.
constexpr int kAgreeing = 50;

double norm(const RawTriad& raw, double scale) noexcept {
  return scale *
         std::hypot(static_cast<double>(raw[0]), static_cast<double>(raw[1]), static_cast<double>(raw[2]));
}

bool is_rest(const RawTriad& acceleration, const RawTriad& rate) noexcept {
  return std::abs(norm(acceleration, kAcceleration_mps2) - kMps2PerG) < kGravityTolerance_mps2 &&
         norm(rate, kRate_radps) < kRateAtRest_radps;
}

}  // namespace

void HighRateResolver::add(const RawTriad& first, const RawTriad& second) noexcept {
  if (order_ != HighRateOrder::kUnknown) return;
  HighRateOrder now = HighRateOrder::kUnknown;
  if (is_rest(first, second)) {
    now = HighRateOrder::kAccelerationFirst;
  } else if (is_rest(second, first)) {
    now = HighRateOrder::kRateFirst;
  }
  in_a_row_ = now == candidate_ ? in_a_row_ + 1 : 1;
  candidate_ = now;
  if (now != HighRateOrder::kUnknown && in_a_row_ >= kAgreeing) order_ = now;
}

}  // namespace imuscope::xsens_can
