#include "models/noise/resonances.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <numbers>

namespace imuscope::noise {
namespace {

/// Bins of the spectrum that resonances are looked for in: enough to tell a width of a hundredth of the rate.
constexpr std::size_t kSegment = 512;
/// The slow rise of every sensor's noise begins below.
constexpr std::size_t kFirstBin = 6;
/// Half the width of the smoothing, bins.
constexpr std::size_t kSmooth = 2;
/// A peak lower than this share above its floor is left to the model.
constexpr double kLeastHeight = 1.05;

/// Logarithm of the density, smoothed over neighbouring bins, with the sd of a bin.
struct Smoothed {
  std::vector<double> log_density;  ///< of bin kFirstBin and on
  double sd = 0.0;
};

Smoothed smoothed(const Spectrum& spectrum, double rate_hz) {
  Smoothed out;
  const std::size_t last = spectrum.power.size() - 2;
  for (std::size_t k = kFirstBin; k <= last; ++k) {
    const std::size_t from = std::max(k - kSmooth, kFirstBin - kSmooth);
    const std::size_t to = std::min(k + kSmooth, last);
    double sum = 0.0;
    for (std::size_t i = from; i <= to; ++i) sum += std::log(density_at(spectrum, i, rate_hz));
    out.log_density.push_back(sum / static_cast<double>(to - from + 1));
  }
  constexpr double kIndependent = 1.5;  // neighbouring bins of a Hann window
  const double dof = degrees_of_freedom(static_cast<double>(spectrum.segments));
  out.sd = std::sqrt(2.0 / dof * kIndependent / static_cast<double>(2 * kSmooth + 1));
  return out;
}

/// The lowest place between here and the next higher peak on one side.
std::size_t foot(const std::vector<double>& y, std::size_t peak, int direction) {
  std::size_t lowest = peak;
  for (std::size_t i = peak;;) {
    if ((direction < 0 && i == 0) || (direction > 0 && i + 1 == y.size())) break;
    i = direction < 0 ? i - 1 : i + 1;
    if (y[i] > y[peak]) break;
    if (y[i] < y[lowest]) lowest = i;
  }
  return lowest;
}

/// Nearest place on one side at which the density is down to half of its height above the floor.
double half_height(const std::vector<double>& y, std::size_t peak, double floor_log, int direction) {
  const double half = std::log(0.5 * (std::exp(y[peak]) + std::exp(floor_log)));
  std::size_t i = peak;
  while (y[i] > half) {
    if ((direction < 0 && i == 0) || (direction > 0 && i + 1 == y.size())) return static_cast<double>(i);
    i = direction < 0 ? i - 1 : i + 1;
  }
  const std::size_t inner = direction < 0 ? i + 1 : i - 1;
  const double share = (y[inner] - half) / (y[inner] - y[i]);
  return static_cast<double>(inner) + direction * share;
}

}  // namespace

std::vector<Resonance> find_resonances(Spectra& spectra, double rate_hz, double false_alarm) {
  if (spectra.samples().size() < kSegment) return {};
  const Spectrum& spectrum = spectra.of(kSegment);
  constexpr std::size_t kFewest = 20;  // fewer tell no height
  if (spectrum.segments < kFewest) return {};
  const Smoothed s = smoothed(spectrum, rate_hz);
  const std::vector<double>& y = s.log_density;
  const double bin_hz = rate_hz / static_cast<double>(kSegment);
  const boost::math::normal normal;
  std::vector<Resonance> found;
  for (std::size_t k = 1; k + 1 < y.size(); ++k) {
    if (y[k] < y[k - 1] || y[k] <= y[k + 1]) continue;
    const std::size_t left = foot(y, k, -1);
    const std::size_t right = foot(y, k, 1);
    // The higher foot is the floor: a rise towards one side alone is no peak.
    const double floor_log = std::max(y[left], y[right]);
    const double height = y[k] - floor_log;
    // Peak and feet are the extremes of some thirty places each.
    const double z = height / (std::sqrt(2.0) * s.sd);
    const double p = std::min(
        1.0, static_cast<double>(y.size() * y.size()) * boost::math::cdf(boost::math::complement(normal, z)));
    if (p > false_alarm || height < std::log(kLeastHeight)) continue;
    Resonance r;
    r.frequency_hz = static_cast<double>(k + kFirstBin) * bin_hz;
    r.width_hz = (half_height(y, k, floor_log, 1) - half_height(y, k, floor_log, -1)) * bin_hz;
    r.height = std::exp(height);
    r.p_value = p;
    double power = 0.0;
    for (std::size_t i = left; i <= right; ++i) {
      const double share =
          right > left ? static_cast<double>(i - left) / static_cast<double>(right - left) : 0.0;
      const double below = std::exp(y[left] + share * (y[right] - y[left]));
      power += std::max(0.0, std::exp(y[i]) - below) * bin_hz;
    }
    r.rms = std::sqrt(power);
    found.push_back(r);
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.rms > b.rms; });
  return found;
}

std::optional<double> low_pass_hz(Spectra& spectra, double rate_hz) {
  if (spectra.samples().size() < kSegment) return std::nullopt;
  const Spectrum& spectrum = spectra.of(kSegment);
  constexpr std::size_t kFewest = 20;
  if (spectrum.segments < kFewest) return std::nullopt;
  const std::vector<double> y = smoothed(spectrum, rate_hz).log_density;
  // The plateau: the median of the second to sixth tenth, which neither slow noise nor the end of the band
  // reaches.
  std::vector<double> middle(y.begin() + static_cast<std::ptrdiff_t>(y.size() / 10),
                             y.begin() + static_cast<std::ptrdiff_t>(y.size() * 6 / 10));
  const auto at = middle.begin() + static_cast<std::ptrdiff_t>(middle.size() / 2);
  std::nth_element(middle.begin(), at, middle.end());
  const double half = *at - std::numbers::ln2;
  std::size_t end = y.size();
  while (end > 0 && y[end - 1] < half) --end;
  constexpr double kHighest = 0.95;
  if (static_cast<double>(end) > kHighest * static_cast<double>(y.size()) || end == 0) return std::nullopt;
  const double bin_hz = rate_hz / static_cast<double>(kSegment);
  return static_cast<double>(end + kFirstBin) * bin_hz;
}

std::string in_words(const Resonance& r, std::string_view unit) {
  return fmt::format("a resonance at {:.3g} Hz, {:.2g} Hz wide, {:.2g} {} rms, {:.2g} times the floor",
                     r.frequency_hz, r.width_hz, r.rms, unit, r.height);
}

}  // namespace imuscope::noise
