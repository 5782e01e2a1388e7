#include "estimation/alignment/reference_window.h"

#include <algorithm>
#include <cmath>

#include "base/contracts.h"
#include "base/limits.h"

namespace imuscope {

namespace {

constexpr std::size_t kOrder = 4;
constexpr std::size_t kCoefficients = kOrder + 1;
constexpr std::size_t kPointsMax = 11;
/// Where the three vectors of an entry begin.
constexpr std::size_t kOmega = 0;
constexpr std::size_t kForce = 3;
constexpr std::size_t kAngularAcceleration = 6;
/// A spacing above this many periods means that a sample is missing.
constexpr double kGapPeriods = 1.5;

/// weights[d][i]: what sample i adds to the d-th derivative of the fitted polynomial at x = 0.
using DerivativeWeights = std::array<std::array<double, kPointsMax>, kCoefficients>;

/// least-squares polynomial through samples at x[0..points), by polynomials that are orthogonal on just
/// these abscissae (Forsythe's recurrence): well conditioned, and no equations to solve.
DerivativeWeights derivative_weights(const std::array<double, kPointsMax>& x, std::size_t points,
                                     std::size_t derivatives) noexcept {
  DerivativeWeights weights{};
  std::array<double, kPointsMax>
      current{};  // the orthogonal polynomial of the running degree, at the samples
  std::array<double, kPointsMax> previous{};
  std::array<double, kCoefficients> current_at_0{1.0};  // its derivatives at 0
  std::array<double, kCoefficients> previous_at_0{};
  current.fill(1.0);
  double previous_norm = 1.0;
  for (std::size_t degree = 0;; ++degree) {
    double norm = 0.0;
    double centre = 0.0;
    for (std::size_t i = 0; i < points; ++i) {
      const double square = current[i] * current[i];
      norm += square;
      centre += x[i] * square;
    }
    const double per_norm = 1.0 / norm;
    for (std::size_t d = 0; d < derivatives && d <= degree; ++d) {
      const double share = current_at_0[d] * per_norm;
      for (std::size_t i = 0; i < points; ++i) weights[d][i] += share * current[i];
    }
    if (degree == kOrder) return weights;
    const double alpha = centre * per_norm;
    const double beta = degree == 0 ? 0.0 : norm / previous_norm;
    for (std::size_t i = 0; i < points; ++i) {
      const double next = (x[i] - alpha) * current[i] - beta * previous[i];
      previous[i] = current[i];
      current[i] = next;
    }
    // Leibniz: (x p)^(d) = x p^(d) + d p^(d-1), at x = 0.
    for (std::size_t d = kOrder + 1; d-- > 0;) {
      const double lower = d == 0 ? 0.0 : static_cast<double>(d) * current_at_0[d - 1];
      const double next = lower - alpha * current_at_0[d] - beta * previous_at_0[d];
      previous_at_0[d] = current_at_0[d];
      current_at_0[d] = next;
    }
    previous_norm = norm;
  }
}

bool all_finite(const Vector3& v) noexcept {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

}  // namespace

ReferenceWindow::ReferenceWindow(const ReferenceWindowOptions& options)
    : options_(options), ring_(reference_window_capacity(1.0 / options.period_s)) {
  IMUSCOPE_EXPECTS(options.points == 5 || options.points == 7 || options.points == 9 || options.points == 11);
  IMUSCOPE_EXPECTS(options.period_s > 0.0);
}

bool ReferenceWindow::push(const Sample& sample) noexcept {
  IMUSCOPE_EXPECTS(sample.kind == SampleKind::kImu);
  const ImuData& imu = sample.imu;
  const bool has_acceleration = (imu.flags & kHasAngularAcceleration) != 0U;
  if (!all_finite(imu.omega_radps) || !all_finite(imu.f_mps2) ||
      (has_acceleration && !all_finite(imu.angular_acceleration_radps2))) {
    return false;
  }
  Entry entry{};
  entry.is_mean = (imu.flags & kIsIncrement) != 0U;
  entry.time = sample.time;
  if (entry.is_mean) entry.time -= from_seconds(0.5 * options_.period_s);
  if (size_ > 0 && entry.time <= at(size_ - 1).time) return false;
  entry.has_angular_acceleration = has_acceleration;
  std::copy_n(imu.omega_radps.data(), 3, entry.values.data() + kOmega);
  std::copy_n(imu.f_mps2.data(), 3, entry.values.data() + kForce);
  if (has_acceleration)
    std::copy_n(imu.angular_acceleration_radps2.data(), 3, entry.values.data() + kAngularAcceleration);
  ring_[head_] = entry;
  head_ = (head_ + 1) % ring_.size();
  size_ = std::min(size_ + 1, ring_.size());
  return true;
}

const ReferenceWindow::Entry& ReferenceWindow::at(std::size_t index) const noexcept {
  return ring_[(head_ + ring_.size() - size_ + index) % ring_.size()];
}

std::size_t ReferenceWindow::nearest(HostTime time) const noexcept {
  // First sample that is not earlier, by bisection.
  std::size_t low = 0;
  std::size_t high = size_;
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (at(middle).time < time) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  if (low == 0) return 0;
  if (low == size_) return size_ - 1;
  return time - at(low - 1).time < at(low).time - time ? low - 1 : low;
}

ReferenceResult ReferenceWindow::evaluate(HostTime time, ReferenceKinematics& out) const noexcept {
  const auto half = static_cast<std::size_t>(options_.points / 2);
  const auto points = static_cast<std::size_t>(options_.points);
  if (size_ < points) return ReferenceResult::kTooNew;
  const std::size_t centre = nearest(time);
  if (centre < half) return ReferenceResult::kTooOld;
  if (centre + half >= size_) return ReferenceResult::kTooNew;  // E-2

  // Half the window as the unit of x keeps the normal equations well conditioned for any width.
  const double scale_s = options_.period_s * static_cast<double>(half);
  std::array<double, kPointsMax> x{};
  std::array<const double*, kPointsMax> values{};
  bool acceleration_given = true;
  for (std::size_t i = 0; i < points; ++i) {
    const Entry& entry = at(centre - half + i);
    x[i] = to_seconds(entry.time - time) / scale_s;
    values[i] = entry.values.data();
    acceleration_given = acceleration_given && entry.has_angular_acceleration;
    if (i > 0 && (x[i] - x[i - 1]) * scale_s > kGapPeriods * options_.period_s) return ReferenceResult::kGap;
  }
  // A mean's correction needs two derivatives more than those that are asked for.
  const bool is_mean = at(centre).is_mean;
  constexpr std::size_t kAsked = 3;
  DerivativeWeights weights = derivative_weights(x, points, is_mean ? kCoefficients : kAsked);
  // from x to time.
  double per_scale = 1.0;
  for (std::size_t d = 1; d < kCoefficients; ++d) {
    per_scale /= scale_s;
    for (std::size_t i = 0; i < points; ++i) weights[d][i] *= per_scale;
  }
  if (is_mean) {
    // a mean over T shows y + y'' T^2/24.
    const double k = options_.period_s * options_.period_s / 24.0;
    for (std::size_t d = 0; d < kAsked; ++d) {
      for (std::size_t i = 0; i < points; ++i) weights[d][i] -= k * weights[d + 2][i];
    }
  }
  const auto combined = [&](std::size_t derivative, std::size_t first_value) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < points; ++i) {
      const double* const v = values[i] + first_value;
      const double w = weights[derivative][i];
      sum.x() += w * v[0];
      sum.y() += w * v[1];
      sum.z() += w * v[2];
    }
    return sum;
  };
  // the noise of a weighted sum of white samples.
  const auto noise_gain = [&](std::size_t derivative) {
    double sum = 0.0;
    for (std::size_t i = 0; i < points; ++i) sum += weights[derivative][i] * weights[derivative][i];
    return std::sqrt(sum);
  };
  out.omega_radps = combined(0, kOmega);
  out.f_mps2 = combined(0, kForce);
  out.f_dot_mps3 = combined(1, kForce);
  out.angular_acceleration_is_measured = acceleration_given;
  if (acceleration_given) {
    out.omega_dot_radps2 = combined(0, kAngularAcceleration);
    out.omega_ddot_radps3 = combined(1, kAngularAcceleration);
  } else {
    out.omega_dot_radps2 = combined(1, kOmega);
    out.omega_ddot_radps3 = combined(2, kOmega);
  }
  out.value_noise_gain = noise_gain(0);
  out.derivative_noise_gain_per_s = noise_gain(1);
  return ReferenceResult::kOk;
}

}  // namespace imuscope
