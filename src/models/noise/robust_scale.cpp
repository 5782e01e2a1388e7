#include "models/noise/robust_scale.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "base/contracts.h"

namespace imuscope::noise {
namespace {

/// Moments E[r^(2k) ; |r| <= c] of N(0,1), k = 0..kMoments-1.
constexpr int kMoments = 16;
std::array<double, kMoments> truncated_moments(double c) {
  std::array<double, kMoments> m{};
  const double density = std::exp(-0.5 * c * c) / std::sqrt(2.0 * std::numbers::pi);
  m[0] = std::erf(c / std::numbers::sqrt2);
  double power = c;  // c^(2k-1)
  for (std::size_t k = 1; k < kMoments; ++k) {
    m[k] = static_cast<double>(2 * k - 1) * m[k - 1] - 2.0 * power * density;
    power *= c * c;
  }
  return m;
}

/// Coefficients of (1 - y)^4 and (1 - y)^8.
constexpr std::array<double, 5> kPower4{1, -4, 6, -4, 1};
constexpr std::array<double, 9> kPower8{1, -8, 28, -56, 70, -56, 28, -8, 1};

/// r^2 (1 - (r/c)^2)^4 for q = r^2, and zero beyond c.
double chi(double q, double inverse_c2) {
  const double y = 1.0 - q * inverse_c2;
  if (y <= 0.0) return 0.0;
  const double y2 = y * y;
  return q * y2 * y2;
}

/// Bits of a double above which a histogram bin lies: sign, exponent and 8 bits of mantissa, 256 bins an
/// octave.
constexpr unsigned kBinShift = 44;
std::uint64_t bin_of(double square) { return std::bit_cast<std::uint64_t>(square) >> kBinShift; }

struct Bin {
  double centre;
  double count;
};

/// Squares w^2 in logarithmic bins, for the scan over all scales.
std::vector<Bin> histogram(std::span<const double> w) {
  std::uint64_t low = ~std::uint64_t{0};
  std::uint64_t high = 0;
  for (const double v : w) {
    if (v == 0.0) continue;
    const std::uint64_t bin = bin_of(v * v);
    low = std::min(low, bin);
    high = std::max(high, bin);
  }
  if (low > high) return {};
  std::vector<std::uint32_t> counts(high - low + 1);
  for (const double v : w) {
    if (v != 0.0) ++counts[bin_of(v * v) - low];
  }
  std::vector<Bin> bins;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const double from = std::bit_cast<double>((low + i) << kBinShift);
    const double to = std::bit_cast<double>((low + i + 1) << kBinShift);
    bins.push_back({0.5 * (from + to), static_cast<double>(counts[i])});
  }
  return bins;
}

double excess_of_bins(const std::vector<Bin>& bins, double total, double s2, double c, double target) {
  const double inverse_c2 = 1.0 / (c * c);
  double sum = 0.0;
  for (const Bin& bin : bins) {
    if (bin.centre > c * c * s2) break;
    sum += bin.count * chi(bin.centre / s2, inverse_c2);
  }
  return sum / total - target;
}

double excess(std::span<const double> w, double s2, double c, double target) {
  const double inverse_s2 = 1.0 / s2;
  const double inverse_c2 = 1.0 / (c * c);
  std::array<double, 4> sums{};
  std::size_t i = 0;
  for (; i + 4 <= w.size(); i += 4) {
    for (std::size_t k = 0; k < 4; ++k) {
      const double q = w[i + k] * w[i + k] * inverse_s2;
      const double y = std::max(1.0 - q * inverse_c2, 0.0);
      sums[k] += q * (y * y) * (y * y);
    }
  }
  for (; i < w.size(); ++i) sums[0] += chi(w[i] * w[i] * inverse_s2, inverse_c2);
  return ((sums[0] + sums[1]) + (sums[2] + sums[3])) / static_cast<double>(w.size()) - target;
}

/// Root of the excess inside [low, high], excess(low) >= 0 > excess(high): regula falsi with the Illinois
/// rule on log(s2).
double solve(std::span<const double> w, double low, double high, double f_low, double f_high, double c,
             double target) {
  constexpr double kRelative = 1e-14;
  constexpr int kMaxSteps = 200;
  double x_low = std::log(low);
  double x_high = std::log(high);
  int side = 0;
  for (int step = 0; step < kMaxSteps && x_high - x_low > kRelative; ++step) {
    double x = (x_low * f_high - x_high * f_low) / (f_high - f_low);
    if (!(x > x_low && x < x_high)) x = 0.5 * (x_low + x_high);
    if (x <= x_low || x >= x_high) break;
    const double f = excess(w, std::exp(x), c, target);
    if (f >= 0.0) {
      x_low = x;
      f_low = f;
      if (side == 1) f_high *= 0.5;
      side = 1;
      if (f == 0.0) break;
    } else {
      x_high = x;
      f_high = f;
      if (side == -1) f_low *= 0.5;
      side = -1;
    }
    if (std::abs(f) < 1e-15) return std::exp(x);
  }
  return std::exp(std::abs(f_low) < std::abs(f_high) ? x_low : x_high);
}

/// The scale around `centre` at which the excess is largest, by golden section on its logarithm.
double maximiser(std::span<const double> w, double centre, double c, double target) {
  constexpr double kHalfWidth = 0.1;
  constexpr double kRelative = 1e-9;
  const double ratio = 1.0 / std::numbers::phi;
  double low = std::log(centre) - kHalfWidth;
  double high = std::log(centre) + kHalfWidth;
  const auto f = [&](double x) { return excess(w, std::exp(x), c, target); };
  double left = high - ratio * (high - low);
  double right = low + ratio * (high - low);
  double f_left = f(left);
  double f_right = f(right);
  while (high - low > kRelative) {
    if (f_left >= f_right) {
      high = right;
      right = left;
      f_right = f_left;
      f_left = f(left = high - ratio * (high - low));
    } else {
      low = left;
      left = right;
      f_left = f_right;
      f_right = f(right = low + ratio * (high - low));
    }
  }
  return std::exp(0.5 * (low + high));
}

/// G-3. The largest root; where the excess stays negative, as it may for few independent coefficients, the
/// scale at which it comes closest: there the two roots have just met.
double root(std::span<const double> w, double c, double target) {
  const std::vector<Bin> bins = histogram(w);
  double mean_square = 0.0;
  double non_zero = 0.0;
  for (const Bin& bin : bins) {
    mean_square += bin.count * bin.centre;
    non_zero += bin.count;
  }
  const auto total = static_cast<double>(w.size());
  if (non_zero < 0.5 * total) return 0.0;
  mean_square /= total;
  // No root lies above mean(w^2)/a(c), since chi(r) <= r^2: walk down from there to the first change of sign.
  constexpr double kStep = 1.02;
  double high = 1.01 * mean_square / target;
  double best = high;
  double best_excess = -1.0;
  const double lowest = bins.front().centre / (c * c);
  for (; high > lowest; high /= kStep) {
    const double e = excess_of_bins(bins, total, high / kStep, c, target);
    if (e > best_excess) {
      best_excess = e;
      best = high / kStep;
    }
    if (e >= 0.0) break;
  }
  double low = best;
  double f_low = excess(w, low, c, target);
  if (f_low < 0.0) {
    // The bins blur the equation by their width, or there is no root.
    low = maximiser(w, best, c, target);
    f_low = excess(w, low, c, target);
    if (f_low < 0.0) return low;
  }
  high = std::max(high, low * kStep);
  double f_high = excess(w, high, c, target);
  while (f_high >= 0.0) f_high = excess(w, high *= kStep, c, target);
  return solve(w, low, high, f_low, f_high, c, target);
}

}  // namespace

double biweight_expectation(double c) {
  const auto m = truncated_moments(c);
  double sum = 0.0;
  double scale = 1.0;
  for (std::size_t k = 0; k < kPower4.size(); ++k) {
    sum += kPower4[k] * scale * m[k + 1];
    scale /= c * c;
  }
  return sum;
}

double biweight_efficiency(double c) {
  const auto m = truncated_moments(c);
  const double mean = biweight_expectation(c);
  double second = 0.0;  // E[chi^2]
  double scale = 1.0;
  for (std::size_t k = 0; k < kPower8.size(); ++k) {
    second += kPower8[k] * scale * m[k + 2];
    scale /= c * c;
  }
  double slope = 0.0;  // E[r chi'(r)] / 2: coefficient k of r^(2k+2) gains (k + 1)
  scale = 1.0;
  for (std::size_t k = 0; k < kPower4.size(); ++k) {
    slope += kPower4[k] * scale * static_cast<double>(k + 1) * m[k + 1];
    scale /= c * c;
  }
  // The Gaussian variance estimator has asymptotic variance 2 s2^2.
  return 2.0 * slope * slope / (second - mean * mean);
}

std::vector<double> biweight_correlation_terms(double efficiency) {
  const double c = biweight_constant(efficiency);
  const auto m = truncated_moments(c);
  // Mean of r^(2k) chi(r).
  const auto chi_moment = [&](std::size_t k) {
    double sum = 0.0;
    double scale = 1.0;
    for (std::size_t i = 0; i < kPower4.size(); ++i) {
      sum += kPower4[i] * scale * m[i + 1 + k];
      scale /= c * c;
    }
    return sum;
  };
  // Even Hermite polynomials He_2 .. He_10 by the powers 0, 2, 4, ... of r, and their squared lengths (2m)!.
  constexpr std::array<std::array<double, 6>, 5> kHermite{{{-1, 1, 0, 0, 0, 0},
                                                           {3, -6, 1, 0, 0, 0},
                                                           {-15, 45, -15, 1, 0, 0},
                                                           {105, -420, 210, -28, 1, 0},
                                                           {-945, 4725, -3150, 630, -45, 1}}};
  constexpr std::array<double, 5> kSquaredLength{2, 24, 720, 40320, 3628800};
  std::vector<double> terms;
  double left = 2.0 / efficiency;
  double slope = 0.0;
  for (std::size_t order = 0; order < kHermite.size(); ++order) {
    double projection = 0.0;
    for (std::size_t k = 0; k < kHermite[order].size(); ++k) projection += kHermite[order][k] * chi_moment(k);
    if (order == 0) slope = 0.5 * projection;  // E[r chi'] / 2, by Stein's identity
    terms.push_back(projection * projection / (kSquaredLength[order] * slope * slope));
    left -= terms.back();
  }
  terms.push_back(std::max(left, 0.0));
  return terms;
}

double biweight_constant(double efficiency) {
  IMUSCOPE_EXPECTS(efficiency >= 0.2 && efficiency <= 0.99);
  double low = 2.0;
  double high = 40.0;
  while (high - low > 1e-14 * high) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (biweight_efficiency(middle) < efficiency ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

RobustScale biweight_scale(std::span<const double> w, double c) {
  IMUSCOPE_EXPECTS(!w.empty() && c > 0.0);
  RobustScale result;
  result.s2 = root(w, c, biweight_expectation(c));
  const double limit = c * c * result.s2;
  const auto rejected = std::count_if(w.begin(), w.end(), [&](double v) { return v * v > limit; });
  result.rejected_share = static_cast<double>(rejected) / static_cast<double>(w.size());
  return result;
}

}  // namespace imuscope::noise
