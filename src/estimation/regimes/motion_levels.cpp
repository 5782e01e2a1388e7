#include "estimation/regimes/motion_levels.h"

#include <algorithm>
#include <cmath>

namespace imuscope {

namespace {

constexpr std::int64_t kCell_ns = 100'000'000;
constexpr auto kCellsMax = static_cast<std::int64_t>(MotionLevels::kLongestRun_s / MotionLevels::kCell_s);
static_assert(static_cast<double>(kCell_ns) * 1e-9 == MotionLevels::kCell_s);

std::int64_t number_of(HostTime time) {
  const std::int64_t ns = to_ns(time);
  return ns >= 0 ? ns / kCell_ns : (ns + 1) / kCell_ns - 1;
}

/// Takes value number n into the mean; returns what it adds to the squares of the deviations from it.
double squares_after(double value, double n, double& mean) {
  const double before = value - mean;
  mean += before / n;
  return before * (value - mean);
}

}  // namespace

/// The cell of that time; nullptr beyond the longest run.
MotionLevels::Sums* MotionLevels::at(HostTime time) {
  const std::int64_t number = number_of(time);
  if (!first_) first_ = number;
  const std::int64_t end = *first_ + static_cast<std::int64_t>(sums_.size());
  if (number >= *first_ + kCellsMax || number < end - kCellsMax) return nullptr;
  if (number < *first_) {
    sums_.insert(sums_.begin(), static_cast<std::size_t>(*first_ - number), Sums{});
    first_ = number;
  }
  const auto index = static_cast<std::size_t>(number - *first_);
  if (index >= sums_.size()) sums_.resize(index + 1);
  return &sums_[index];
}

void MotionLevels::add(HostTime time, const Vector3& omega_ib_b_radps, const Vector3& f_b_mps2) {
  Sums* const cell = at(time);
  if (cell == nullptr) return;
  Sums& sums = *cell;
  ++sums.n;
  const auto n = static_cast<double>(sums.n);
  for (std::size_t i = 0; i < 3; ++i) {
    sums.omega_squares += omega_ib_b_radps[i] * omega_ib_b_radps[i];
    sums.omega_deviation_squares += squares_after(omega_ib_b_radps[i], n, sums.mean_omega[i]);
    sums.f_deviation_squares += squares_after(f_b_mps2[i], n, sums.mean_f[i]);
  }
}

void MotionLevels::add_speed(HostTime time, double speed_mps, double sd_mps) {
  Sums* const cell = at(time);
  if (cell == nullptr) return;
  cell->speed_mps = std::abs(speed_mps);
  cell->speed_sd_mps = sd_mps;
}

void MotionLevels::forget_before(HostTime time) {
  if (!first_) return;
  const std::int64_t n =
      std::clamp<std::int64_t>(number_of(time) - *first_, 0, static_cast<std::int64_t>(sums_.size()));
  sums_.erase(sums_.begin(), sums_.begin() + n);
  *first_ += n;
}

HostTime MotionLevels::begin_of(std::size_t index) const {
  return host_time_from_ns((first_.value_or(0) + static_cast<std::int64_t>(index)) * kCell_ns);
}

std::vector<MotionCell> MotionLevels::cells() const {
  const auto held = static_cast<std::size_t>(kSpeedHeld_s / kCell_s);
  std::vector<MotionCell> cells(sums_.size());
  std::size_t age = held + 1;  // so that the first cell holds no speed of one before it
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Sums& sums = sums_[i];
    MotionCell& cell = cells[i];
    cell.n = sums.n;
    cell.omega_radps = sums.mean_omega;
    cell.f_mps2 = sums.mean_f;
    if (sums.n > 0) cell.rate_rms_radps = std::sqrt(sums.omega_squares / static_cast<double>(sums.n));
    if (sums.n > 1) {
      cell.vibration_mps2 = std::sqrt(sums.f_deviation_squares / static_cast<double>(sums.n - 1));
      cell.rate_scatter_radps = std::sqrt(sums.omega_deviation_squares / static_cast<double>(sums.n - 1));
    }
    age = sums.speed_mps ? 0 : age + 1;
    if (sums.speed_mps) {
      cell.speed_mps = sums.speed_mps;
      cell.speed_sd_mps = sums.speed_sd_mps;
    } else if (age <= held) {
      cell.speed_mps = cells[i - 1].speed_mps;
      cell.speed_sd_mps = cells[i - 1].speed_sd_mps;
    }
  }
  return cells;
}

}  // namespace imuscope
