#include "noise/process.h"

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

/// sum_{k>=3} (-a)^k / k! (4 (1+n)^k - (1+2n)^k - 3 - n 2^k): the numerator of gauss_markov_wv() for small n
/// a. The terms k < 3 vanish identically; that is the cancellation.
CurvePoint series_numerator(double a, double n) noexcept {
  constexpr double kRelativeStop = 1e-18;
  constexpr int kMaxTerms = 80;
  double p_next = 1.0;    // ((1+n) a)^k / k!
  double p_double = 1.0;  // ((1+2n) a)^k / k!
  double p_one = 1.0;     // a^k / k!
  double p_two = 1.0;     // (2a)^k / k!
  CurvePoint sum;
  double sign = 1.0;
  for (int k = 1; k < kMaxTerms; ++k) {
    p_next *= (1.0 + n) * a / k;
    p_double *= (1.0 + 2.0 * n) * a / k;
    p_one *= a / k;
    p_two *= 2.0 * a / k;
    sign = -sign;
    if (k < 3) continue;
    const double term = sign * (4.0 * p_next - p_double - 3.0 * p_one - n * p_two);
    sum.value += term;
    sum.derivative[0] += term * k / a;
    if (std::abs(term) * k < kRelativeStop * std::abs(sum.value)) break;
  }
  return sum;
}

/// exp(-x) and what it lacks to one, both to the last digit, by one evaluation.
struct Decay {
  double left = 1.0;
  double lost = 0.0;
};

Decay decay_of(double x) noexcept {
  constexpr double kHalf = 0.5;
  if (x < kHalf) {
    const double lost = -std::expm1(-x);
    return {1.0 - lost, lost};
  }
  const double left = std::exp(-x);
  return {left, 1.0 - left};
}

CurvePoint closed_numerator(double a, double n, const Decay& one) noexcept {
  const auto [phi, v] = one;
  const auto [phi_n, u] = decay_of(n * a);
  const double du = n * phi_n;
  CurvePoint numerator;
  numerator.value = n * v * (1.0 + phi) - phi * u * (2.0 + u);
  numerator.derivative[0] = 2.0 * n * phi * phi + phi * u * (2.0 + u) - phi * (2.0 + 2.0 * u) * du;
  return numerator;
}

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

/// G-6 for a complex rate s, z = exp(-s): the curve and its derivative by s. Of small n |s| the numerator is
/// summed as the series of series_numerator(), which holds for complex s as well.
struct ComplexCurve {
  Complex value;
  Complex slope;
};

ComplexCurve complex_exponential_wv(Complex s, double n) {
  Complex numerator;
  Complex d_numerator;
  const Complex z = std::exp(-s);
  if (n * n * std::norm(s) < kSeriesBelow * kSeriesBelow) {
    constexpr double kRelativeStop = 1e-18;
    constexpr int kMaxTerms = 80;
    Complex p_next = 1.0, p_double = 1.0, p_one = 1.0, p_two = 1.0;
    double sign = 1.0;
    for (int k = 1; k < kMaxTerms; ++k) {
      const auto order = static_cast<double>(k);
      p_next *= (1.0 + n) * s / order;
      p_double *= (1.0 + 2.0 * n) * s / order;
      p_one *= s / order;
      p_two *= 2.0 * s / order;
      sign = -sign;
      if (k < 3) continue;
      const Complex term = sign * (4.0 * p_next - p_double - 3.0 * p_one - n * p_two);
      numerator += term;
      d_numerator += term * order / s;
      if (std::abs(term) * order < kRelativeStop * std::abs(numerator)) break;
    }
  } else {
    // Below this the power is lost beside one.
    constexpr double kNothing = 60.0;
    const Complex z_n = n * s.real() < kNothing ? std::exp(-n * s) : 0.0;
    numerator = n * (1.0 - z * z) - z * (1.0 - z_n) * (3.0 - z_n);
    d_numerator = 2.0 * n * z * z + z * (1.0 - z_n) * (3.0 - z_n) - z * n * z_n * (4.0 - 2.0 * z_n);
  }
  const Complex one_less = 1.0 - z;
  const Complex inverse = std::conj(one_less) / std::norm(one_less);
  const Complex scale = inverse * inverse / (2.0 * n * n);
  const Complex value = numerator * scale;
  return {value, d_numerator * scale - value * 2.0 * z * inverse};
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
  const Decay one = decay_of(a);
  const auto [phi, v] = one;
  const CurvePoint numerator = n * a < kSeriesBelow ? series_numerator(a, n) : closed_numerator(a, n, one);
  const double denominator = 2.0 * n * n * v * v;
  const double value = numerator.value / denominator;
  return {value, {numerator.derivative[0] / denominator - value * 2.0 * phi / v, 0.0}};
}

CurvePoint resonance_wv(double a, double b, int level) noexcept {
  IMUSCOPE_EXPECTS(a > 0.0 && b > 0.0 && level >= 1 && level <= kMaxLevel);
  const Complex weight(1.0, -a / b);
  const auto [value, slope] = complex_exponential_wv(Complex(a, -b), half_support(level));
  CurvePoint out;
  out.value = (weight * value).real();
  out.derivative[0] = (weight * slope - Complex(0.0, 1.0 / b) * value).real();
  out.derivative[1] = (weight * slope * Complex(0.0, -1.0) + Complex(0.0, a / (b * b)) * value).real();
  return out;
}

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

CurvePoint unit_wv(ProcessKind kind, const Shape& shape, int level) noexcept {
  IMUSCOPE_EXPECTS(level >= 1 && level <= kMaxLevel);
  const double n = half_support(level);
  const double tau = 2.0 * n;
  switch (kind) {
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

}  // namespace imuscope::noise
