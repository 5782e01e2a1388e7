#include "models/certificate/temperature.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <vector>

#include "models/noise/whitener.h"

namespace imuscope::certificate {
namespace {

/// Windows over which the variance of fast noise is held against the temperature.
constexpr std::size_t kWindows = 40;
constexpr std::size_t kLeastWindow = 500;

struct Range {
  double mean = 0.0;
  double lowest = 0.0;
  double highest = 0.0;
  std::size_t n = 0;
};

bool is_there(std::span<const double> x, std::span<const std::uint8_t> mask, std::span<const float> t,
              std::size_t i) {
  return (mask.empty() || mask[i] != 0) && std::isfinite(x[i]) && std::isfinite(t[i]);
}

Range range_of(std::span<const double> x, std::span<const std::uint8_t> mask, std::span<const float> t) {
  Range range;
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (!is_there(x, mask, t, i)) continue;
    const auto now = static_cast<double>(t[i]);
    range.lowest = range.n == 0 ? now : std::min(range.lowest, now);
    range.highest = range.n == 0 ? now : std::max(range.highest, now);
    range.mean += (now - range.mean) / static_cast<double>(++range.n);
  }
  return range;
}

/// Least-squares line through (x, y) with the sd of its slope from the scatter; absent with fewer than three
/// places.
struct Slope {
  double value = 0.0;
  double sd = 0.0;
};

std::optional<Slope> slope_of(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  if (x.size() < 3) return std::nullopt;
  double mx = 0.0;
  double my = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mx += x[i] / n;
    my += y[i] / n;
  }
  double sxx = 0.0;
  double sxy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    sxx += (x[i] - mx) * (x[i] - mx);
    sxy += (x[i] - mx) * (y[i] - my);
  }
  if (!(sxx > 0.0)) return std::nullopt;
  Slope slope{sxy / sxx, 0.0};
  double rest = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double r = y[i] - my - slope.value * (x[i] - mx);
    rest += r * r;
  }
  slope.sd = std::sqrt(rest / (n - 2.0) / sxx);
  return slope;
}

/// Bias by generalised least squares: both columns go through the noise's own whitening filter (T-2).
void add_bias(Temperature& out, std::span<const double> x, std::span<const std::uint8_t> mask,
              std::span<const float> t, const noise::Model& model) {
  constexpr std::size_t kColumns = 3;  // signal, constant, temperature
  noise::Whitener whitener(model, kColumns);
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!is_there(x, mask, t, i)) {
      whitener.skip();
      continue;
    }
    std::array<double, kColumns> row{x[i], 1.0, static_cast<double>(t[i]) - out.mean_c};
    if (!whitener.push(row)) continue;
    const Eigen::Vector2d a(row[1], row[2]);
    normal += a * a.transpose();
    right += a * row[0];
  }
  const Eigen::LDLT<Eigen::Matrix2d> ldlt(normal);
  const Eigen::Matrix2d covariance = ldlt.solve(Eigen::Matrix2d::Identity());
  out.bias_per_c = ldlt.solve(right)[1];
  out.bias_per_c_sd = std::sqrt(std::max(0.0, covariance(1, 1)));
  if (out.bias_per_c_sd > 0.0) {
    const double z = std::abs(out.bias_per_c) / out.bias_per_c_sd;
    out.bias_p_value = 2.0 * boost::math::cdf(boost::math::complement(boost::math::normal(), z));
  }
}

/// T-2: logarithm of the mean square of successive differences, window by window, on the windows' temperature.
void add_noise(Temperature& out, std::span<const double> x, std::span<const std::uint8_t> mask,
               std::span<const float> t) {
  const std::size_t length = x.size() / kWindows;
  if (length < kLeastWindow) return;
  std::vector<double> temperature;
  std::vector<double> log_variance;
  for (std::size_t w = 0; w < kWindows; ++w) {
    double square = 0.0;
    double mean_t = 0.0;
    std::size_t n = 0;
    for (std::size_t i = w * length + 1; i < (w + 1) * length; ++i) {
      if (!is_there(x, mask, t, i) || !is_there(x, mask, t, i - 1)) continue;
      square += (x[i] - x[i - 1]) * (x[i] - x[i - 1]);
      mean_t += static_cast<double>(t[i]);
      ++n;
    }
    if (n < kLeastWindow / 2 || !(square > 0.0)) continue;
    temperature.push_back(mean_t / static_cast<double>(n));
    log_variance.push_back(std::log(square / static_cast<double>(n)));
  }
  if (const auto slope = slope_of(temperature, log_variance)) {
    out.noise_per_c = slope->value;
    out.noise_per_c_sd = slope->sd;
  }
}

}  // namespace

std::optional<Temperature> temperature_of(std::span<const double> x, std::span<const std::uint8_t> mask,
                                          std::span<const float> temperature_c, const noise::FitResult& fit) {
  if (temperature_c.size() != x.size()) return std::nullopt;
  const Range range = range_of(x, mask, temperature_c);
  if (range.n == 0 || range.highest - range.lowest < kLeastRange_c) return std::nullopt;
  const auto& terms = fit.model.components;
  if (std::ranges::none_of(terms, [](const auto& term) { return term.amplitude > 0.0; })) return std::nullopt;
  Temperature out;
  out.mean_c = range.mean;
  out.lowest_c = range.lowest;
  out.highest_c = range.highest;
  add_bias(out, x, mask, temperature_c, fit.model);
  add_noise(out, x, mask, temperature_c);
  return out;
}

}  // namespace imuscope::certificate
