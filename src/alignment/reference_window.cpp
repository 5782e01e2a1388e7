#include "alignment/reference_window.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/contracts.h"

namespace imuscope {

namespace {

constexpr int kOrder = 4;
constexpr int kCoefficients = kOrder + 1;
constexpr int kPointsMax = 11;
constexpr int kValues = 9;
/// A spacing above this many periods means that a sample is missing.
constexpr double kGapPeriods = 1.5;

using Polynomial = Eigen::Matrix<double, kCoefficients, kValues>;

/// Least-squares polynomial in x = (t_i - t)/scale, so that its derivatives at the instant are its
/// coefficients.
struct Fit {
  Polynomial coefficients;
  double value_noise_gain;
  double slope_noise_gain;  ///< per unit of x
};

Fit fit(const double* x, const std::array<const double*, kPointsMax>& values, int points) noexcept {
  Eigen::Matrix<double, kCoefficients, kCoefficients> normal =
      Eigen::Matrix<double, kCoefficients, kCoefficients>::Zero();
  Polynomial right = Polynomial::Zero();
  for (int i = 0; i < points; ++i) {
    Eigen::Matrix<double, kCoefficients, 1> powers;
    powers(0) = 1.0;
    for (int k = 1; k < kCoefficients; ++k) powers(k) = powers(k - 1) * x[i];
    normal.noalias() += powers * powers.transpose();
    right.noalias() +=
        powers * Eigen::Map<const Eigen::Matrix<double, 1, kValues>>(values[static_cast<std::size_t>(i)]);
  }
  const Eigen::LLT<Eigen::Matrix<double, kCoefficients, kCoefficients>> factor(normal);
  Fit out;
  out.coefficients = factor.solve(right);
  // the covariance of the coefficients for unit white noise is the inverse normal matrix.
  using Vector = Eigen::Matrix<double, kCoefficients, 1>;
  out.value_noise_gain = factor.matrixL().solve(Vector::Unit(0)).norm();
  out.slope_noise_gain = factor.matrixL().solve(Vector::Unit(1)).norm();
  return out;
}

bool all_finite(const Vector3& v) noexcept {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

}  // namespace

ReferenceWindow::ReferenceWindow(const ReferenceWindowOptions& options) noexcept : options_(options) {
  IMUSCOPE_EXPECTS(options.points >= kCoefficients && options.points <= kPointsMax &&
                   options.points % 2 == 1);
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
  std::copy_n(imu.omega_radps.data(), 3, entry.values.data());
  std::copy_n(imu.f_mps2.data(), 3, entry.values.data() + 3);
  if (has_acceleration) std::copy_n(imu.angular_acceleration_radps2.data(), 3, entry.values.data() + 6);
  ring_[head_] = entry;
  head_ = (head_ + 1) % kCapacity;
  size_ = std::min(size_ + 1, kCapacity);
  return true;
}

const ReferenceWindow::Entry& ReferenceWindow::at(std::size_t index) const noexcept {
  return ring_[(head_ + kCapacity - size_ + index) % kCapacity];
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

HostTime ReferenceWindow::newest_time() const noexcept {
  const auto half = static_cast<std::size_t>(options_.points / 2);
  if (size_ <= half + 1) return HostTime::min();
  // Half-way between the newest centre that has its window and the one after: beyond it the next is nearer.
  const HostTime centre = at(size_ - 1 - half).time;
  const HostTime next = at(size_ - half).time;
  return centre + (next - centre) / 2 - Duration{1};
}

void ReferenceWindow::clear() noexcept {
  head_ = 0;
  size_ = 0;
}

ReferenceResult ReferenceWindow::evaluate(HostTime time, ReferenceKinematics& out) const noexcept {
  const auto half = static_cast<std::size_t>(options_.points / 2);
  const auto points = static_cast<std::size_t>(options_.points);
  if (size_ < points) return ReferenceResult::kTooNew;
  const std::size_t centre = nearest(time);
  if (centre < half) return ReferenceResult::kTooOld;
  if (centre + half >= size_) return ReferenceResult::kTooNew;

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
  const Fit polynomial = fit(x.data(), values, options_.points);
  const Polynomial& c = polynomial.coefficients;

  // derivatives at the instant.
  const double d1 = 1.0 / scale_s;
  const double d2 = 2.0 * d1 * d1;
  const double d3 = 6.0 * d1 * d1 * d1;
  const double d4 = 24.0 * d1 * d1 * d1 * d1;
  using Row = Eigen::Matrix<double, 1, kValues>;
  Row value = c.row(0);
  Row first = d1 * c.row(1);
  Row second = d2 * c.row(2);
  if (at(centre).is_mean) {
    // a mean over T shows y + y'' T^2/24.
    const double k = options_.period_s * options_.period_s / 24.0;
    value -= k * second;
    first -= k * d3 * c.row(3);
    second -= k * d4 * c.row(4);
  }
  out.omega_radps = value.head<3>().transpose();
  out.f_mps2 = value.segment<3>(3).transpose();
  out.f_dot_mps3 = first.segment<3>(3).transpose();
  out.angular_acceleration_is_measured = acceleration_given;
  if (acceleration_given) {
    out.omega_dot_radps2 = value.tail<3>().transpose();
    out.omega_ddot_radps3 = first.tail<3>().transpose();
  } else {
    out.omega_dot_radps2 = first.head<3>().transpose();
    out.omega_ddot_radps3 = second.head<3>().transpose();
  }
  out.value_noise_gain = polynomial.value_noise_gain;
  out.derivative_noise_gain_per_s = d1 * polynomial.slope_noise_gain;
  return ReferenceResult::kOk;
}

}  // namespace imuscope
