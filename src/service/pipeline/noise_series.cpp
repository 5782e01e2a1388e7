#include "service/pipeline/noise_series.h"

#include <algorithm>

#include "base/contracts.h"

namespace imuscope {

namespace {

constexpr std::array kAxisNames{"gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"};

/// A hole longer than this is not padded sample by sample (one hour at 100 Hz): the counter began anew. All
/// holes together are padded with as many, and with twice as many as there are samples: a counter that jumps
/// and jumps takes no memory that the recording does not have.
constexpr std::int64_t kLongestHole = 360'000;
constexpr std::int64_t kPaddedPerSample = 2;

/// Bits of a sample's triads.
constexpr std::uint8_t kGyroBit = 1;
constexpr std::uint8_t kAccelBit = 2;
std::uint8_t triad_bit(std::size_t axis) { return axis < 3 ? kGyroBit : kAccelBit; }

}  // namespace

std::string axis_name(std::size_t axis) { return kAxisNames[axis]; }
std::string axis_unit(std::size_t axis) { return axis < 3 ? "rad/s" : "m/s^2"; }

void NoiseSeries::add(const ErrorRow& row, std::optional<std::size_t> regime) {
  IMUSCOPE_EXPECTS(!regime || *regime < kMaxRegimes);
  if (started_ && row.counter < next_counter_) return;
  const auto present = static_cast<std::int64_t>(size() - missing_);
  const std::int64_t room = kLongestHole + kPaddedPerSample * present - static_cast<std::int64_t>(missing_);
  const std::int64_t hole = started_ ? std::min({row.counter - next_counter_, kLongestHole, room}) : 0;
  missing_ += static_cast<std::size_t>(hole);
  const std::size_t padded = size() + static_cast<std::size_t>(hole);
  times_.resize(padded, times_.empty() ? row.time : times_.back());
  times_.push_back(row.time);
  regimes_.resize(padded, kNoRegime);
  regimes_.push_back(regime ? static_cast<std::uint8_t>(*regime) : kNoRegime);
  valid_.resize(padded, 0);
  valid_.push_back(
      static_cast<std::uint8_t>((row.gyro_valid ? kGyroBit : 0) | (row.accel_valid ? kAccelBit : 0)));
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    values_[axis].resize(padded, 0.0);
    values_[axis].push_back(axis < 3 ? row.e_gyro_radps[axis] : row.e_accel_mps2[axis - 3]);
  }
  started_ = true;
  next_counter_ = row.counter + 1;
}

std::vector<std::uint8_t> NoiseSeries::mask(std::size_t axis) const {
  std::vector<std::uint8_t> mask = valid_;
  for (std::uint8_t& there : mask) there = (there & triad_bit(axis)) != 0 ? 1 : 0;
  return mask;
}

std::vector<std::uint8_t> NoiseSeries::mask(std::size_t axis, std::size_t regime) const {
  std::vector<std::uint8_t> mask = this->mask(axis);
  for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = mask[i] != 0 && regimes_[i] == regime ? 1 : 0;
  return mask;
}

}  // namespace imuscope
