#include "estimation/batch/grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace imuscope::batch {

namespace {

constexpr double kPi = std::numbers::pi;
/// A step beyond this lacks samples.
constexpr double kLossStep_periods = 1.5;
/// Longest step that is bridged: two samples missing in a row.
constexpr double kLongestBridged_periods = 3.5;
/// Entries a second of the kernel's table; linear between them errs by less than 1e-7.
constexpr double kTableRate_hz = 20000.0;

/// B-1: sinc times a squared cosine, and its derivative.
class Kernel {
 public:
  Kernel() {
    for (std::size_t i = 0; i < value_.size(); ++i) {
      const double x = static_cast<double>(i) / kTableRate_hz;
      value_[i] = at(x);
      slope_[i] = (at(x + kStep_s) - at(x - kStep_s)) / (2.0 * kStep_s);
    }
  }
  [[nodiscard]] double value(double x) const { return look_up(value_, std::abs(x)); }
  [[nodiscard]] double slope(double x) const { return x < 0.0 ? -look_up(slope_, -x) : look_up(slope_, x); }

 private:
  static constexpr double kStep_s = 1e-5;
  static constexpr std::size_t kEntries = static_cast<std::size_t>(kKernelHalf_s * kTableRate_hz) + 2;

  static double at(double x) {
    if (std::abs(x) >= kKernelHalf_s) return 0.0;
    const double phase = 2.0 * kPi * kLowPass_hz * x;
    const double sinc = std::abs(phase) < 1e-9 ? 1.0 : std::sin(phase) / phase;
    const double taper = std::cos(kPi * x / (2.0 * kKernelHalf_s));
    return sinc * taper * taper;
  }
  static double look_up(const std::array<double, kEntries>& table, double x) {
    const double position = x * kTableRate_hz;
    const auto i = static_cast<std::size_t>(position);
    if (i + 1 >= kEntries) return 0.0;
    const double part = position - static_cast<double>(i);
    return table[i] + part * (table[i + 1] - table[i]);
  }

  std::array<double, kEntries> value_{};
  std::array<double, kEntries> slope_{};
};

const Kernel& kernel() {
  static const Kernel one;
  return one;
}

using Row6 = Eigen::Matrix<double, 1, 6>;

Row6 sample_row(const ImuRecord& record, std::size_t i) {
  Row6 row;
  row << record.omega_radps[i].cast<double>().transpose(), record.f_mps2[i].cast<double>().transpose();
  return row;
}

/// Weighted mean of the samples under the kernel, its derivative, and the mean of their products (B-2).
struct Evaluated {
  Row6 value = Row6::Zero();
  Row6 slope = Row6::Zero();
  Row6 products = Row6::Zero();
};

Evaluated evaluate(const ImuRecord& record, double instant, std::size_t first, std::size_t last,
                   bool as_reference) {
  double weight = 0.0;
  double weight_slope = 0.0;
  Evaluated sum;
  for (std::size_t i = first; i < last; ++i) {
    const double x = instant - record.time_s[i];
    const Row6 row = sample_row(record, i);
    const double k = kernel().value(x);
    weight += k;
    sum.value += k * row;
    if (!as_reference) continue;
    sum.products += k * products_of(row.head<3>());
    const double dk = kernel().slope(x);
    weight_slope += dk;
    sum.slope += dk * row;
  }
  sum.value /= weight;
  sum.products /= weight;
  // Derivative of a quotient, so that a constant has none, however the samples lie.
  if (as_reference) sum.slope = (sum.slope - weight_slope * sum.value) / weight;
  return sum;
}

}  // namespace

Row6 products_of(const Eigen::RowVector3d& omega_radps) {
  const auto& v = omega_radps;
  return {v[0] * v[0], v[1] * v[1], v[2] * v[2], v[0] * v[1], v[0] * v[2], v[1] * v[2]};
}

double sample_period_s(const ImuRecord& record) {
  std::vector<double> steps(record.size() - 1);
  for (std::size_t i = 0; i < steps.size(); ++i) steps[i] = record.time_s[i + 1] - record.time_s[i];
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

namespace {

/// B-2: the record with single lost samples, and two in a row, put in by the cubic through their neighbours: left
/// out, they would shift the mean under the kernel by a part of the motion.
ImuRecord bridged(const ImuRecord& record, double period_s) {
  ImuRecord out;
  const std::size_t n = record.size();
  for (std::size_t i = 0; i < n; ++i) {
    out.add(record.time_s[i], record.omega_radps[i], record.f_mps2[i]);
    if (i == 0 || i + 2 >= n) continue;
    const double step_s = record.time_s[i + 1] - record.time_s[i];
    if (step_s < kLossStep_periods * period_s || step_s > kLongestBridged_periods * period_s) continue;
    const int missing = static_cast<int>(std::lround(step_s / period_s)) - 1;
    for (int j = 1; j <= missing; ++j) {
      const double t = record.time_s[i] + step_s * j / (missing + 1);
      Eigen::Matrix<float, 3, 2> value = Eigen::Matrix<float, 3, 2>::Zero();
      for (std::size_t a = i - 1; a <= i + 2; ++a) {  // Lagrange
        double weight = 1.0;
        for (std::size_t b = i - 1; b <= i + 2; ++b)
          if (b != a) weight *= (t - record.time_s[b]) / (record.time_s[a] - record.time_s[b]);
        value.col(0) += static_cast<float>(weight) * record.omega_radps[a];
        value.col(1) += static_cast<float>(weight) * record.f_mps2[a];
      }
      out.add(t, value.col(0), value.col(1));
    }
  }
  return out;
}

}  // namespace

Grid make_grid(const ImuRecord& recorded, const std::vector<double>& instants, bool as_reference) {
  const double period_s = sample_period_s(recorded);
  const ImuRecord record = bridged(recorded, period_s);
  const auto n = static_cast<Eigen::Index>(instants.size());
  Grid grid;
  grid.motion.setZero(n, 6);
  if (as_reference) grid.omega_dot.setZero(n, 3);
  if (as_reference) grid.products.setZero(n, 6);
  grid.valid.assign(instants.size(), 0);
  const double longest_step_s = kLossStep_periods * period_s;
  // Where the newest step that is too long lies, seen from each sample.
  std::vector<double> gap_end(record.size(), -1e300);
  for (std::size_t i = 1; i < record.size(); ++i) {
    const bool gap = record.time_s[i] - record.time_s[i - 1] > longest_step_s;
    gap_end[i] = gap ? record.time_s[i] : gap_end[i - 1];
  }
  std::size_t first = 0;
  std::size_t last = 0;
  for (Eigen::Index row = 0; row < n; ++row) {
    const double instant = instants[static_cast<std::size_t>(row)];
    while (first < record.size() && record.time_s[first] <= instant - kKernelHalf_s) ++first;
    last = std::max(last, first);
    while (last < record.size() && record.time_s[last] < instant + kKernelHalf_s) ++last;
    const bool inside = first > 0 && last < record.size() && last > first;
    if (!inside || gap_end[last] > record.time_s[first]) continue;
    const Evaluated at = evaluate(record, instant, first, last, as_reference);
    grid.motion.row(row) = at.value;
    if (as_reference) {
      grid.omega_dot.row(row) = at.slope.head<3>();
      grid.products.row(row) = at.products;
    }
    grid.valid[static_cast<std::size_t>(row)] = 1;
  }
  return grid;
}

}  // namespace imuscope::batch
