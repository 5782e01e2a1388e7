#include "estimation/navigation/heading_solver.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "base/units.h"

namespace imuscope {

namespace {

using Complex = std::complex<double>;

constexpr std::size_t kWindowsMin = 8;
constexpr std::size_t kWindowsMax = 256;
constexpr int kLinearIterations = 10;
constexpr int kNewtonIterations = 10;
/// The mean squared change of velocity must exceed this to tell a direction, m^2/s^2.
constexpr double kChangeMin_m2ps2 = 0.01;
/// Tukey's biweight gives no weight beyond this many sd; 4.685 keeps 95 % efficiency on normal errors.
constexpr double kTukeyLimit = 4.685;
/// Median of |e| of a two-dimensional normal error, in units of its sd per axis.
constexpr double kMedianOfRayleigh = 1.17741;

Complex as_complex(const Eigen::Vector2d& v) noexcept { return {v.x(), v.y()}; }

using Weights = std::array<double, kWindowsMax>;

/// Residual sd per axis from the median length, so that outliers do not widen it.
template <typename Residual>
double robust_sd(std::size_t n, const Residual& residual) noexcept {
  std::array<double, kWindowsMax> length{};
  for (std::size_t i = 0; i < n; ++i) length[i] = std::abs(residual(i));
  const auto middle = length.begin() + static_cast<std::ptrdiff_t>(n / 2);
  std::nth_element(length.begin(), middle, length.begin() + static_cast<std::ptrdiff_t>(n));
  return *middle / kMedianOfRayleigh;
}

template <typename Residual>
void tukey_weights(std::size_t n, double sd, const Residual& residual, Weights& weights) noexcept {
  for (std::size_t i = 0; i < n; ++i) {
    const double u = std::abs(residual(i)) / (kTukeyLimit * sd);
    weights[i] = u < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0;
  }
}

/// N-44: seen = A felt + B half_span with complex A and B, by reweighted least squares that starts from
/// least absolute deviations.
struct Linear {
  Complex A;
  Complex B;
};

bool fit_linear(std::span<const VelocityChange> windows, Weights& weights, Linear& out) noexcept {
  const std::size_t n = windows.size();
  std::fill_n(weights.begin(), n, 1.0);
  for (int iteration = 0; iteration < kLinearIterations; ++iteration) {
    double yy = 0.0;
    double tt = 0.0;
    Complex yt = 0.0;
    Complex zy = 0.0;
    Complex zt = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const Complex y = as_complex(windows[i].felt_a_mps);
      const Complex z = as_complex(windows[i].seen_n_mps);
      const double t = windows[i].half_span_s;
      const double w = weights[i];
      yy += w * std::norm(y);
      tt += w * t * t;
      yt += w * t * y;
      zy += w * z * std::conj(y);
      zt += w * t * z;
    }
    const double determinant = yy * tt - std::norm(yt);
    if (!(determinant > kChangeMin_m2ps2 * tt)) return false;
    out.A = (zy * tt - zt * std::conj(yt)) / determinant;
    out.B = (zt * yy - zy * yt) / determinant;
    const auto residual = [&](std::size_t i) {
      return as_complex(windows[i].seen_n_mps) - out.A * as_complex(windows[i].felt_a_mps) -
             out.B * windows[i].half_span_s;
    };
    const double sd = std::max(robust_sd(n, residual), 1e-6);
    for (std::size_t i = 0; i < n; ++i) weights[i] = 1.0 / std::max(std::abs(residual(i)) / sd, 0.1);
  }
  return true;
}

}  // namespace

bool solve_heading(std::span<const VelocityChange> windows, const HeadingPriors& priors,
                   HeadingSolution& out) noexcept {
  if (windows.size() < kWindowsMin) return false;
  if (windows.size() > kWindowsMax) windows = windows.last(kWindowsMax);
  const std::size_t n = windows.size();
  Weights weights{};
  Linear linear;
  if (!fit_linear(windows, weights, linear)) return false;

  // N-45: seen = exp(i (psi - beta age)) (felt + c half_span). Unknown psi, beta, c; beta and c with priors.
  Eigen::Vector4d x(std::arg(linear.A), 0.0, 0.0, 0.0);
  const auto prediction = [&](const VelocityChange& w) {
    return std::polar(1.0, x(0) - x(1) * w.age_s) *
           (as_complex(w.felt_a_mps) + w.half_span_s * Complex(x(2), x(3)));
  };
  const auto residual = [&](std::size_t i) {
    return as_complex(windows[i].seen_n_mps) - prediction(windows[i]);
  };
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  double sd = 1.0;
  for (int iteration = 0; iteration < kNewtonIterations; ++iteration) {
    double receiver_sd = 0.0;
    for (const VelocityChange& w : windows) receiver_sd += w.sd_mps / static_cast<double>(n);
    // The prior of c needs a scale at the first step too: the linear fit's residuals give it.
    sd = std::max(robust_sd(n, residual), std::max(receiver_sd, 1e-4));
    tukey_weights(n, sd, residual, weights);
    const double variance = sd * sd * priors.window_overlap;
    information.setZero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      const VelocityChange& w = windows[i];
      const Complex turn = std::polar(1.0, x(0) - x(1) * w.age_s);
      const Complex p = prediction(w);
      const Complex by_psi = Complex(0.0, 1.0) * p;
      const std::array<Complex, 4> J{by_psi, -w.age_s * by_psi, w.half_span_s * turn,
                                     Complex(0.0, w.half_span_s) * turn};
      const Complex e = as_complex(w.seen_n_mps) - p;
      for (int r = 0; r < 4; ++r) {
        const Complex conj_r = std::conj(J[static_cast<std::size_t>(r)]);
        right(r) += weights[i] / variance * (conj_r * e).real();
        for (int c = 0; c < 4; ++c) {
          information(r, c) += weights[i] / variance * (conj_r * J[static_cast<std::size_t>(c)]).real();
        }
      }
    }
    const Eigen::Vector3d prior_information(
        1.0 / (priors.gyro_bias_sd_radps * priors.gyro_bias_sd_radps),
        1.0 / (priors.acceleration_sd_mps2 * priors.acceleration_sd_mps2),
        1.0 / (priors.acceleration_sd_mps2 * priors.acceleration_sd_mps2));
    information.diagonal().tail<3>() += prior_information;
    right.tail<3>() -= prior_information.cwiseProduct(x.tail<3>());
    const Eigen::LDLT<Eigen::Matrix4d> factor(information);
    if (factor.info() != Eigen::Success || !factor.isPositive()) return false;
    const Eigen::Vector4d step = factor.solve(right);
    if (!step.allFinite()) return false;
    x += step;
    if (std::abs(step(0)) < 1e-6) break;
  }
  const Eigen::Matrix4d covariance = information.inverse();
  double share = 0.0;
  for (std::size_t i = 0; i < n; ++i) share += weights[i] / static_cast<double>(n);
  out.heading_rad = std::remainder(x(0), 2.0 * kPi);
  out.sd_rad = std::sqrt(covariance(0, 0));
  out.acceleration_error_a_mps2 = x.tail<2>();
  out.acceleration_error_sd_mps2 = std::sqrt(std::max(covariance(2, 2), covariance(3, 3)));
  out.scale = std::abs(linear.A);
  out.weight_share = share;
  return std::isfinite(out.sd_rad);
}

}  // namespace imuscope
