#include "models/noise/spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <unsupported/Eigen/FFT>

#include "models/noise/chi_squared.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {
namespace {

/// Of a segment's samples so many may be missing.
constexpr double kMostMissing = 0.125;
/// From one length of a density's segments to the next.
constexpr std::size_t kLongerOfDensity = 4;

std::vector<double> hann(std::size_t n) {
  std::vector<double> window(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double phase = 2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
    window[i] = 0.5 - 0.5 * std::cos(phase);
  }
  return window;
}

/// Sum of the squares of a Hann window of n samples.
double window_power(std::size_t n) { return 0.375 * static_cast<double>(n); }

}  // namespace

Present::Present(std::span<const double> x, std::span<const std::uint8_t> mask)
    : runs_(valid_segments(x, mask)), size_(x.size()) {
  if (runs_.size() == 1 && runs_.front().begin == 0 && runs_.front().end == size_) return;
  words_.resize(size_ / kWord + 1);
  for (const Segment& run : runs_) {
    for (std::size_t i = run.begin; i < run.end; ++i)
      words_[i / kWord].there |= std::uint64_t{1} << (i % kWord);
  }
  for (std::size_t w = 1; w < words_.size(); ++w)
    words_[w].before = words_[w - 1].before + static_cast<std::uint64_t>(std::popcount(words_[w - 1].there));
}

// G-23: half overlap, an eighth missing at most
std::vector<std::size_t> Present::segments(std::size_t length) const {
  std::vector<std::size_t> begins;
  const auto least = static_cast<std::size_t>((1.0 - kMostMissing) * static_cast<double>(length));
  std::size_t begin = 0;
  for (const Segment& run : runs_) {
    // From the beginning of a run on, as long as there is enough; else from the next run.
    for (begin = std::max(begin, run.begin);
         begin < run.end && begin + length <= size_ && count(begin, begin + length) >= least;
         begin += length / 2)
      begins.push_back(begin);
  }
  return begins;
}

// G-23: mean periodogram
Spectrum spectrum_of(std::span<const double> x, const Present& present, std::size_t length) {
  const auto window = hann(length);
  const double whole = std::accumulate(window.begin(), window.end(), 0.0);
  Spectrum out;
  out.length = length;
  out.power.assign(length / 2 + 1, 0.0);
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<double> piece(length);
  std::vector<std::complex<double>> transform;
  for (const std::size_t begin : present.segments(length)) {
    double mean = 0.0;
    double there = 0.0;
    const auto n = static_cast<double>(present.count(begin, begin + length));
    for (std::size_t i = 0; i < length; ++i) {
      if (!present.at(begin + i)) continue;
      mean += x[begin + i] / n;
      there += window[i];
    }
    const double gain = whole / there;
    for (std::size_t i = 0; i < length; ++i)
      piece[i] = present.at(begin + i) ? gain * window[i] * (x[begin + i] - mean) : 0.0;
    fft.fwd(transform, piece);
    for (std::size_t k = 0; k < out.power.size(); ++k) out.power[k] += std::norm(transform[k]);
    ++out.segments;
  }
  for (double& p : out.power) p /= static_cast<double>(std::max<std::size_t>(out.segments, 1));
  return out;
}

const Spectrum& Spectra::of(std::size_t length) {
  const auto at = made_.find(length);
  if (at != made_.end()) return at->second;
  return made_.emplace(length, spectrum_of(x_, present_, length)).first->second;
}

void Spectra::make(std::span<const std::size_t> lengths, const ForEachIndex& for_each) {
  std::vector<std::map<std::size_t, Spectrum>::value_type*> empty;
  for (const std::size_t length : lengths) {
    const auto [at, is_new] = made_.try_emplace(length);
    if (is_new) empty.push_back(&*at);
  }
  // The longest take longest: begun last, they would be waited for.
  std::ranges::sort(empty, [](const auto* a, const auto* b) { return a->first > b->first; });
  for_each(empty.size(),
           [&](std::size_t i) { empty[i]->second = spectrum_of(x_, present_, empty[i]->first); });
}

// G-23: dof
double degrees_of_freedom(double segments) { return 36.0 * segments * segments / (19.0 * segments - 1.0); }

double density_at(const Spectrum& spectrum, std::size_t bin, double rate_hz) {
  // Half of the power lies at negative frequencies, but at the ends.
  const bool is_end = bin == 0 || bin + 1 == spectrum.power.size();
  return (is_end ? 1.0 : 2.0) * spectrum.power[bin] / (rate_hz * window_power(spectrum.length));
}

std::vector<std::size_t> segments_of_density(const Spectra& spectra, std::size_t shortest) {
  // Beyond, memory grows for a single look at what is slow, which the wavelet variance shows better.
  constexpr std::size_t kLongest = std::size_t{1} << 20U;
  std::vector<std::size_t> lengths;
  for (std::size_t length = shortest; length <= std::min(spectra.samples().size(), kLongest);
       length *= kLongerOfDensity) {
    if (spectra.present().segments(length).empty()) break;
    lengths.push_back(length);
  }
  return lengths;
}

std::vector<DensityPoint> density_of(Spectra& spectra, double rate_hz, double confidence,
                                     int points_per_octave, std::size_t shortest) {
  // From this bin on a segment's spectrum is not bent by what leaks from below; longer segments take over
  // there.
  constexpr std::size_t kFirstUnbentBin = 8;
  const double tail = 0.5 * (1.0 - confidence);
  std::vector<DensityPoint> points;  // from high frequencies to low
  std::size_t last = shortest / 2 - 1;
  const std::vector<std::size_t> lengths = segments_of_density(spectra, shortest);
  for (const std::size_t length : lengths) {
    const Spectrum& spectrum = spectra.of(length);
    const bool is_longest = length == lengths.back();
    const std::size_t first = is_longest ? 1 : kFirstUnbentBin;
    const double dof_of_bin = degrees_of_freedom(static_cast<double>(spectrum.segments));
    std::size_t high = last;
    while (high >= first) {
      auto low = static_cast<std::size_t>(
          std::floor(static_cast<double>(high) * std::exp2(-1.0 / points_per_octave)));
      low = std::max(low + 1, first);
      low = std::min(low, high);
      double sum = 0.0;
      for (std::size_t k = low; k <= high; ++k) sum += density_at(spectrum, k, rate_hz);
      const auto bins = static_cast<double>(high - low + 1);
      // Neighbouring bins of a Hann window share two thirds of what they tell.
      constexpr double kIndependent = 1.5;
      const double dof = dof_of_bin * std::max(1.0, bins / kIndependent);
      DensityPoint point;
      point.frequency_hz = 0.5 * static_cast<double>(low + high) * rate_hz / static_cast<double>(length);
      point.density = sum / bins;
      point.ci_low = point.density * dof / chi_squared_quantile(dof, 1.0 - tail);
      point.ci_high = point.density * dof / chi_squared_quantile(dof, tail);
      points.push_back(point);
      if (low == 0) break;
      high = low - 1;
    }
    last = kFirstUnbentBin * kLongerOfDensity - 1;
  }
  std::reverse(points.begin(), points.end());
  return points;
}

}  // namespace imuscope::noise
