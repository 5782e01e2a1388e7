#include "models/noise/process.h"

#include <algorithm>
#include <array>
#include <boost/math/special_functions/digamma.hpp>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>

#include "base/contracts.h"

namespace imuscope::noise {
namespace {

/// Below this n*a the numerator loses digits in closed form and is summed as a power series instead.
constexpr double kSeriesBelow = 0.5;
/// phi from which ARMA(1,1) is evaluated as Gauss-Markov plus white noise; below it the closed form is exact.
constexpr double kArmaSplitAbovePhi = 0.5;

/// 2^(level-1).
double half_support(int level) noexcept {
  return static_cast<double>(std::uint64_t{1} << static_cast<unsigned>(level - 1));
}

CurvePoint white_noise(double tau) noexcept { return {1.0 / tau, {}}; }

/// Below kSeriesBelow the numerator of G-6 is exp(-a) (2 n r(a) + h(n a)) with r(a) = sinh(a) - a and
/// h(x) = 2 x - (1 - exp(-x)) (3 - exp(-x)), each by its power series: nothing is left to cancel. That of h
/// is sum_{k>=3} -(-x)^k (2^k - 4) / k!.
constexpr int kSeriesTerms = 17;
constexpr std::array<double, kSeriesTerms> kFallSeries = [] {
  std::array<double, kSeriesTerms> c{};
  double factorial = 2.0;
  double power = 4.0;
  double sign = 1.0;
  for (int i = 0; i < kSeriesTerms; ++i) {
    factorial *= i + 3;
    power *= 2.0;
    c[static_cast<std::size_t>(i)] = sign * (power - 4.0) / factorial;
    sign = -sign;
  }
  return c;
}();

/// A function and its derivative.
template <typename T>
struct Slope {
  T value{};
  T derivative{};
};

/// h(x), |x| < kSeriesBelow.
template <typename T>
Slope<T> fall_series(T x) noexcept {
  T sum{};
  T slope{};
  for (int i = kSeriesTerms - 1; i >= 0; --i) {
    const double c = kFallSeries[static_cast<std::size_t>(i)];
    sum = sum * x + c;
    slope = slope * x + c * (i + 3.0);
  }
  const T square = x * x;
  return {sum * square * x, slope * square};
}

/// r(a), |a| < kSeriesBelow.
template <typename T>
Slope<T> sinh_series(T a) noexcept {
  constexpr int kTerms = 7;
  const T square = a * a;
  T sum{};
  T slope{};
  for (int i = kTerms; i >= 1; --i) {
    const double even = 2.0 * i;
    sum = (sum * square + 1.0) / (even * (even + 1.0));
    slope = (slope * square + 1.0) / (even * (even - 1.0));
  }
  return {sum * square * a, slope * square};
}

/// G-6: one Gauss-Markov process at any n.
class MarkovCurve {
 public:
  explicit MarkovCurve(double a) noexcept
      : a_(a),
        phi_(std::exp(-a)),
        fall_(-std::expm1(-a)),
        rest_(a < kSeriesBelow ? sinh_series(a) : Slope<double>{}) {}

  [[nodiscard]] bool is_series(double n) const noexcept { return n * a_ < kSeriesBelow; }

  /// @param left  exp(-n a), where it is no series
  [[nodiscard]] CurvePoint at(double n, double left) const noexcept {
    Slope<double> numerator;
    if (is_series(n)) {
      const Slope<double> h = fall_series(n * a_);
      numerator.value = phi_ * (2.0 * n * rest_.value + h.value);
      numerator.derivative = phi_ * n * (2.0 * rest_.derivative + h.derivative) - numerator.value;
    } else {
      const double u = 1.0 - left;
      numerator.value = n * fall_ * (1.0 + phi_) - phi_ * u * (2.0 + u);
      numerator.derivative = 2.0 * n * phi_ * phi_ + phi_ * u * (2.0 + u) - phi_ * (2.0 + 2.0 * u) * n * left;
    }
    const double scale = 1.0 / (2.0 * n * n * fall_ * fall_);
    const double value = numerator.value * scale;
    return {value, {numerator.derivative * scale - value * 2.0 * phi_ / fall_, 0.0}};
  }

 private:
  double a_;
  double phi_;
  double fall_;
  Slope<double> rest_;
};

// G-5: MA1
CurvePoint moving_average(double theta, double tau) noexcept {
  const double tau2 = tau * tau;
  return {((1.0 + theta) * (1.0 + theta) * tau - 6.0 * theta) / tau2,
          {(2.0 * (1.0 + theta) * tau - 6.0) / tau2, 0.0}};
}

/// 2 [(th+phi)(1+th phi)(3 - 4 phi^n + phi^2n) + (1+th)^2 (phi^2-1) n] / ((phi-1)^3 (1+phi) tau^2)
CurvePoint arma_closed(double phi, double theta, double n) noexcept {
  const double tau = 2.0 * n;
  const double phi_n = std::pow(phi, n);
  const double dphi_n = n * std::pow(phi, n - 1.0);
  const double cross = (theta + phi) * (1.0 + theta * phi);
  const double power = 3.0 - 4.0 * phi_n + phi_n * phi_n;
  const double gain = (1.0 + theta) * (1.0 + theta);
  const double numerator = 2.0 * (cross * power + gain * (phi * phi - 1.0) * n);
  const double denominator = std::pow(phi - 1.0, 3) * (1.0 + phi) * tau * tau;
  const double value = numerator / denominator;
  const double dcross_dphi = (1.0 + theta * phi) + (theta + phi) * theta;
  const double dcross_dtheta = (1.0 + theta * phi) + (theta + phi) * phi;
  const double dpower = (-4.0 + 2.0 * phi_n) * dphi_n;
  const double dnum_dphi = 2.0 * (dcross_dphi * power + cross * dpower + gain * 2.0 * phi * n);
  const double dnum_dtheta = 2.0 * (dcross_dtheta * power + 2.0 * (1.0 + theta) * (phi * phi - 1.0) * n);
  const double dlog_denominator = 3.0 / (phi - 1.0) + 1.0 / (1.0 + phi);
  return {value, {dnum_dphi / denominator - value * dlog_denominator, dnum_dtheta / denominator}};
}

/// G-7: the same curve as variance (g1/phi) of a Gauss-Markov process plus white noise of variance g0 -
/// g1/phi, where g0, g1 are the autocovariances at lags 0 and 1.
CurvePoint arma_split(double phi, double theta, int level) noexcept {
  const double tau = std::ldexp(1.0, level);
  const CurvePoint gm = gauss_markov_wv(-std::log(phi), level);
  const double gm_dphi = -gm.derivative[0] / phi;
  const double one = (1.0 - phi) * (1.0 + phi);
  const double cross = (theta + phi) * (1.0 + theta * phi);
  const double share = cross / (phi * one);
  const double dshare_dtheta = ((1.0 + theta * phi) + (theta + phi) * phi) / (phi * one);
  const double dcross_dphi = (1.0 + theta * phi) + (theta + phi) * theta;
  const double dshare_dphi = dcross_dphi / (phi * one) - share * (1.0 / phi - 2.0 * phi / one);
  const double white = -theta / phi;  // g0 - g1/phi, which simplifies to this
  return {share * gm.value + white / tau,
          {dshare_dphi * gm.value + share * gm_dphi + theta / (phi * phi) / tau,
           dshare_dtheta * gm.value - 1.0 / (phi * tau)}};
}

// G-5: sinusoid of random phase
CurvePoint sinusoid(double b, double n) noexcept {
  const double half = 0.5 * b;
  const double s1 = std::sin(half);
  const double sn = std::sin(n * half);
  const double ratio = sn / (n * s1);
  const double value = 0.5 * ratio * ratio * sn * sn;
  // d/db = value (2n cot(nb/2) - cot(b/2)), written without the division by sin(nb/2).
  const double derivative = ratio * ratio * sn * n * std::cos(n * half) - value * std::cos(half) / s1;
  return {value, {derivative, 0.0}};
}

using Complex = std::complex<double>;

/// G-6 for a complex rate s = a - i b with the weight 1 - i a/b: a resonance (G-37) at any n. Of small n |s|
/// the numerator is the series of MarkovCurve, which holds for complex s as well.
class RingingCurve {
 public:
  RingingCurve(double a, double b) noexcept
      : a_(a),
        b_(b),
        s_(a, -b),
        z_(std::exp(-s_)),
        rest_(is_series(1.0) ? sinh_series(s_) : Slope<Complex>{}) {
    const Complex one_less = 1.0 - z_;
    inverse_ = std::conj(one_less) / std::norm(one_less);
  }

  [[nodiscard]] bool is_series(double n) const noexcept {
    return n * n * std::norm(s_) < kSeriesBelow * kSeriesBelow;
  }

  /// exp(-n s); nothing where it is lost beside one.
  [[nodiscard]] Complex left(double n) const noexcept {
    constexpr double kNothing = 60.0;
    return n * a_ < kNothing ? std::exp(-n * s_) : 0.0;
  }

  /// @param left  that of n, where it is no series
  [[nodiscard]] CurvePoint at(double n, Complex left) const noexcept {
    Slope<Complex> numerator;
    if (is_series(n)) {
      const Slope<Complex> h = fall_series(n * s_);
      numerator.value = z_ * (2.0 * n * rest_.value + h.value);
      numerator.derivative = z_ * n * (2.0 * rest_.derivative + h.derivative) - numerator.value;
    } else {
      const Complex power = (1.0 - left) * (3.0 - left);
      numerator.value = n * (1.0 - z_ * z_) - z_ * power;
      numerator.derivative = 2.0 * n * z_ * z_ + z_ * power - z_ * n * left * (4.0 - 2.0 * left);
    }
    const Complex scale = inverse_ * inverse_ / (2.0 * n * n);
    const Complex value = numerator.value * scale;
    const Complex slope = numerator.derivative * scale - value * 2.0 * z_ * inverse_;
    const Complex weight(1.0, -a_ / b_);
    CurvePoint out;
    out.value = (weight * value).real();
    out.derivative[0] = (weight * slope - Complex(0.0, 1.0 / b_) * value).real();
    out.derivative[1] = (weight * slope * Complex(0.0, -1.0) + Complex(0.0, a_ / (b_ * b_)) * value).real();
    return out;
  }

 private:
  double a_;
  double b_;
  Complex s_;
  Complex z_;
  Complex inverse_;
  Slope<Complex> rest_;
};

/// A process whose curve needs exp(-n rate), at n = 1, 2, 4...: squares of one exponential, which is taken
/// where the series ends, so that few squarings follow until nothing is left.
template <typename Curve, typename Exponential, typename Power>
void fill_by_squares(const Curve& curve, Exponential exponential, Power none, std::span<CurvePoint> out) {
  Power left = none;
  bool begun = false;
  double n = 1.0;
  for (CurvePoint& point : out) {
    if (!curve.is_series(n)) {
      left = begun ? left * left : exponential(n);
      begun = true;
    }
    point = curve.at(n, left);
    n *= 2.0;
  }
}

/// ln of Gamma(m + 1/2 + x) / Gamma(m + 1/2 - x) over m^(2x), by Stirling's series in 1/m^2; m >=
/// kStirlingFrom.
constexpr double kStirlingFrom = 40.0;

double log_gamma_ratio_rest(double x, double m) {
  // - sum over odd k >= 3 of 2 B_k(1/2 + x) / (k (k-1) m^(k-1)), as Bernoulli polynomials at 1/2 + x are odd
  // in x there (DLMF 5.11.8).
  const double x2 = x * x;
  const double b3 = x * (x2 - 0.25);
  const double b5 = x * (x2 * x2 - 5.0 / 6.0 * x2 + 7.0 / 48.0);
  const double b7 = x * (x2 * x2 * x2 - 1.75 * x2 * x2 + 49.0 / 48.0 * x2 - 31.0 / 192.0);
  const double r = 1.0 / (m * m);
  return -r * (b3 / 3.0 + r * (b5 / 10.0 + r * b7 / 21.0));
}

/// ln[Gamma(m + 1/2 + x) / Gamma(m + 1/2 - x) / (m^2 - 1/4)], which is zero at x = 1, in terms that all
/// vanish there; x = 1 + off, m a whole number >= 0. Small m is led up to large by Gamma(u + 1) = u Gamma(u).
double power_law_exponent(double off, double m) {
  double sum = 0.0;
  for (; m < kStirlingFrom; m += 1.0) {
    const double u = m + 0.5;
    sum += std::log1p(-off / (u - 1.0)) - std::log1p(off / (u + 1.0));
  }
  return sum + 2.0 * off * std::log(m) + log_gamma_ratio_rest(1.0 + off, m) - log_gamma_ratio_rest(1.0, m);
}

}  // namespace

std::string_view short_name(ProcessKind kind) noexcept {
  switch (kind) {
    case ProcessKind::kQuantization:
      return "QN";
    case ProcessKind::kWhiteNoise:
      return "WN";
    case ProcessKind::kMa1:
      return "MA1";
    case ProcessKind::kArma11:
      return "ARMA11";
    case ProcessKind::kSinusoid:
      return "SIN";
    case ProcessKind::kResonance:
      return "RES";
    case ProcessKind::kGaussMarkov:
      return "GM";
    case ProcessKind::kFlicker:
      return "FN";
    case ProcessKind::kPowerLaw:
      return "PL";
    case ProcessKind::kRandomWalk:
      return "RW";
    case ProcessKind::kRamp:
      return "DR";
  }
  return "?";
}

int shape_count(ProcessKind kind) noexcept {
  switch (kind) {
    case ProcessKind::kArma11:
    case ProcessKind::kResonance:
      return 2;
    case ProcessKind::kMa1:
    case ProcessKind::kSinusoid:
    case ProcessKind::kGaussMarkov:
    case ProcessKind::kPowerLaw:
      return 1;
    default:
      return 0;
  }
}

bool is_in_range(ProcessKind kind, const Shape& shape) noexcept {
  switch (kind) {
    case ProcessKind::kGaussMarkov:
    case ProcessKind::kSinusoid:
      return shape[0] > 0.0 && std::isfinite(shape[0]);
    case ProcessKind::kMa1:
      return std::abs(shape[0]) <= 1.0;
    case ProcessKind::kArma11:
      return std::abs(shape[0]) < 1.0 && std::abs(shape[1]) <= 1.0;
    case ProcessKind::kResonance:
      return shape[0] > 0.0 && std::isfinite(shape[0]) && shape[1] > 0.0 && shape[1] <= std::numbers::pi;
    case ProcessKind::kPowerLaw:
      return shape[0] > 0.0 && shape[0] < 2.0;
    default:
      return true;
  }
}

CurvePoint gauss_markov_wv(double a, int level) noexcept {
  IMUSCOPE_EXPECTS(a > 0.0 && level >= 1 && level <= kMaxLevel);
  const double n = half_support(level);
  const MarkovCurve curve(a);
  return curve.at(n, curve.is_series(n) ? 0.0 : std::exp(-n * a));
}

CurvePoint resonance_wv(double a, double b, int level) noexcept {
  IMUSCOPE_EXPECTS(a > 0.0 && b > 0.0 && level >= 1 && level <= kMaxLevel);
  const double n = half_support(level);
  const RingingCurve curve(a, b);
  return curve.at(n, curve.is_series(n) ? 0.0 : curve.left(n));
}

// G-38: G(m)
double power_law_sum_covariance(double alpha, double m) noexcept {
  // Gamma(m + D) / Gamma(m + 1 - D) / (2 cos(pi D) Gamma(2D)), D = 1 + alpha / 2 = 3/2 + off. At alpha = 1
  // the cosine is zero and the ratio a square of m, which is taken out beforehand.
  const double off = 0.5 * (alpha - 1.0);  // D - 3/2
  const double gamma = std::tgamma(2.0 + alpha);
  const double square = m * m - 0.25;
  if (off == 0.0) {
    const double sum = boost::math::digamma(m + 1.5) + boost::math::digamma(m - 0.5);
    return square * sum / (2.0 * std::numbers::pi * gamma);
  }
  const double cosine = 2.0 * std::sin(std::numbers::pi * off);  // 2 cos(pi D)
  return square * std::expm1(power_law_exponent(off, m)) / (cosine * gamma);
}

namespace {

// G-38 in G-9, at h = 0 of one level
double power_law_value(double alpha, double n) {
  const double sum = 6.0 * power_law_sum_covariance(alpha, 0.0) - 8.0 * power_law_sum_covariance(alpha, n) +
                     2.0 * power_law_sum_covariance(alpha, 2.0 * n);
  return sum / (4.0 * n * n);
}

double flicker_wv(int level) {
  static const std::array<double, kMaxLevel> kCurve = [] {
    std::array<double, kMaxLevel> curve{};
    for (int j = 1; j <= kMaxLevel; ++j)
      curve[static_cast<std::size_t>(j - 1)] = power_law_value(1.0, half_support(j));
    return curve;
  }();
  return kCurve[static_cast<std::size_t>(level - 1)];
}

}  // namespace

CurvePoint power_law_wv(double alpha, int level) noexcept {
  IMUSCOPE_EXPECTS(alpha > 0.0 && alpha < 2.0 && level >= 1 && level <= kMaxLevel);
  const double n = half_support(level);
  constexpr double kStep = 1e-4;  // a central difference: exact to 1e-8 of the curve
  const double step = std::min({kStep, 0.5 * alpha, 0.5 * (2.0 - alpha)});
  return {power_law_value(alpha, n),
          {(power_law_value(alpha + step, n) - power_law_value(alpha - step, n)) / (2.0 * step), 0.0}};
}

double sinusoid_wv(double omega_rad, double n) noexcept { return sinusoid(omega_rad, n).value; }

CurvePoint unit_wv(ProcessKind kind, const Shape& shape, int level) noexcept {
  IMUSCOPE_EXPECTS(level >= 1 && level <= kMaxLevel);
  const double n = half_support(level);
  const double tau = 2.0 * n;
  switch (kind) {  // G-5, where it is no function of its own
    case ProcessKind::kWhiteNoise:
      return white_noise(tau);
    case ProcessKind::kQuantization:
      return {6.0 / (tau * tau), {}};
    case ProcessKind::kRandomWalk:
      return {(tau * tau + 2.0) / (12.0 * tau), {}};
    case ProcessKind::kRamp:
      return {tau * tau / 16.0, {}};
    case ProcessKind::kGaussMarkov:
      return gauss_markov_wv(shape[0], level);
    case ProcessKind::kResonance:
      return resonance_wv(shape[0], shape[1], level);
    case ProcessKind::kFlicker:
      return {flicker_wv(level), {}};
    case ProcessKind::kPowerLaw:
      return power_law_wv(shape[0], level);
    case ProcessKind::kMa1:
      return moving_average(shape[0], tau);
    case ProcessKind::kSinusoid:
      return sinusoid(shape[0], n);
    case ProcessKind::kArma11:
      return shape[0] > kArmaSplitAbovePhi ? arma_split(shape[0], shape[1], level)
                                           : arma_closed(shape[0], shape[1], n);
  }
  return {};
}

void unit_curve(ProcessKind kind, const Shape& shape, std::span<CurvePoint> out) noexcept {
  IMUSCOPE_EXPECTS(out.size() <= static_cast<std::size_t>(kMaxLevel));
  if (kind == ProcessKind::kGaussMarkov) {
    fill_by_squares(
        MarkovCurve(shape[0]), [&](double n) { return std::exp(-n * shape[0]); }, 0.0, out);
  } else if (kind == ProcessKind::kResonance) {
    const RingingCurve curve(shape[0], shape[1]);
    fill_by_squares(
        curve, [&](double n) { return curve.left(n); }, Complex{}, out);
  } else {
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = unit_wv(kind, shape, static_cast<int>(i) + 1);
  }
}

}  // namespace imuscope::noise
