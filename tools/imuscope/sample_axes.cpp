#include "sample_axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "time_column.h"

namespace imuscope::cli {
namespace {

/// Holes longer than this, alone or together, are not filled sample by sample.
constexpr std::int64_t kHolesMost = 10'000'000;
constexpr std::size_t kTriad = 3;

}  // namespace

void AxesSink::on_sample(const Sample& sample) noexcept {
  if (sample.kind != SampleKind::kImu) return;
  if (!first_) first_ = sample.time;
  stamps_s_.push_back(to_seconds(sample.time - *first_));
  for (std::size_t axis = 0; axis < kTriad; ++axis) {
    values_[axis].push_back(sample.imu.omega_radps[axis]);
    values_[kTriad + axis].push_back(sample.imu.f_mps2[axis]);
  }
  flags_.push_back(sample.imu.flags);
  const bool has_temperature = (sample.imu.flags & kHasTemperature) != 0;
  const float before =
      temperature_c_.empty() ? std::numeric_limits<float>::quiet_NaN() : temperature_c_.back();
  temperature_c_.push_back(has_temperature ? sample.imu.temperature_degC : before);
}

Result<SampleAxes> AxesSink::axes(std::optional<double> rate_hz) && {
  const auto rows = rows_of_stamps(stamps_s_, {}, rate_hz);
  if (!rows) return tl::unexpected<Error>(rows.error());
  std::int64_t holes = 0;
  for (const std::int64_t n : rows->missing_before) holes = std::min(holes + n, kHolesMost + 1);
  if (holes > kHolesMost) {
    return work_error(fmt::format("the times leave out more than {} samples", kHolesMost),
                      "cut the file where the long gaps are");
  }
  SampleAxes out;
  const bool has_temperature = !temperature_c_.empty() && std::isfinite(temperature_c_.back());
  for (std::size_t axis = 0; axis < out.axes.size(); ++axis) {
    Signal& signal = out.axes[axis];
    signal.rate_hz = rows->rate_hz;
    const std::uint32_t needed = axis < kTriad ? kGyroValid : kAccelValid;
    for (std::size_t i = 0; i < stamps_s_.size(); ++i) {
      const auto hole = static_cast<std::size_t>(rows->missing_before[i]);
      signal.values.insert(signal.values.end(), hole, 0.0);
      signal.mask.insert(signal.mask.end(), hole, 0);
      const bool is_there = (flags_[i] & needed) != 0;
      signal.values.push_back(is_there ? values_[axis][i] : 0.0);
      signal.mask.push_back(is_there ? 1 : 0);
      if (axis > 0 || !has_temperature) continue;
      out.temperature_c.insert(out.temperature_c.end(), hole, std::numeric_limits<float>::quiet_NaN());
      out.temperature_c.push_back(temperature_c_[i]);
    }
    values_[axis] = {};
  }
  return out;
}

}  // namespace imuscope::cli
