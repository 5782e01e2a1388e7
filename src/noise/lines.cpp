#include "noise/lines.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "noise/process.h"
#include "noise/wavelet_variance.h"

namespace imuscope::noise {
namespace {

/// Half-width of the main lobe of a Hann window, in bins.
constexpr std::size_t kLobe = 2;
/// The noise beside a bin: so many bins to either side, outside of the lobe.
constexpr std::size_t kFloorBins = 40;
/// Degrees of freedom a segment, Hann windows that overlap by half (Welch 1967; 36 K^2 / (19 K - 1)).
double degrees_of_freedom(double segments) { return 36.0 * segments * segments / (19.0 * segments - 1.0); }

std::vector<double> hann(std::size_t n) {
  std::vector<double> window(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double phase = 2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
    window[i] = 0.5 - 0.5 * std::cos(phase);
  }
  return window;
}

/// Mean periodogram of overlapping segments.
struct Spectrum {
  std::vector<double> power;  ///< mean |X_k|^2 of the windowed segments
  std::size_t segments = 0;
};

Spectrum spectrum_of(std::span<const double> x, const std::vector<Segment>& runs, std::size_t length) {
  const auto window = hann(length);
  Spectrum out;
  out.power.assign(length / 2 + 1, 0.0);
  Eigen::FFT<double> fft;
  std::vector<double> piece(length);
  std::vector<std::complex<double>> transform;
  for (const auto& run : runs) {
    for (std::size_t begin = run.begin; begin + length <= run.end; begin += length / 2) {
      double mean = 0.0;
      for (std::size_t i = 0; i < length; ++i) mean += x[begin + i] / static_cast<double>(length);
      for (std::size_t i = 0; i < length; ++i) piece[i] = window[i] * (x[begin + i] - mean);
      fft.fwd(transform, piece);
      for (std::size_t k = 0; k < out.power.size(); ++k) out.power[k] += std::norm(transform[k]);
      ++out.segments;
    }
  }
  for (double& p : out.power) p /= static_cast<double>(std::max<std::size_t>(out.segments, 1));
  return out;
}

/// Median of bins [first, last), as a mean.
double median_power(const Spectrum& spectrum, std::size_t first, std::size_t last, double dof) {
  std::vector<double> bins(spectrum.power.begin() + static_cast<std::ptrdiff_t>(first),
                           spectrum.power.begin() + static_cast<std::ptrdiff_t>(last));
  const auto middle = bins.begin() + static_cast<std::ptrdiff_t>(bins.size() / 2);
  std::nth_element(bins.begin(), middle, bins.end());
  return *middle * dof / boost::math::quantile(boost::math::chi_squared(dof), 0.5);
}

/// Power of the noise at bin k: the geometric mean of what is to its left and to its right, so that a slope
/// does not make a line. At the upper end the left side alone: noise falls with frequency.
double floor_at(const Spectrum& spectrum, std::size_t k, double dof) {
  const double left = median_power(spectrum, k - kLobe - kFloorBins, k - kLobe, dof);
  const std::size_t end = k + kLobe + 1 + kFloorBins;
  if (end > spectrum.power.size()) return left;
  return std::sqrt(left * median_power(spectrum, k + kLobe + 1, end, dof));
}

/// Mean power right beside the window's main lobe. A line leaks a hundredth of its power there at most; of a
/// resonance it is as high as the peak.
double power_beside(const Spectrum& spectrum, std::size_t k) {
  constexpr std::size_t kBeside = 6;
  double sum = 0.0;
  double n = 0.0;
  for (std::size_t d = kLobe + 1; d <= kLobe + kBeside; ++d) {
    sum += spectrum.power[k - d];
    n += 1.0;
    if (k + d >= spectrum.power.size()) continue;
    sum += spectrum.power[k + d];
    n += 1.0;
  }
  return sum / n;
}

/// Offset of a peak from its bin, for a Hann window: (b - a) / (a + 2 c + b) times 2 of the neighbours'
/// magnitudes (Grandke 1983 in symmetric form).
double offset_of(double left, double peak, double right) {
  const double a = std::sqrt(std::max(left, 0.0));
  const double c = std::sqrt(peak);
  const double b = std::sqrt(std::max(right, 0.0));
  return std::clamp(2.0 * (b - a) / (a + 2.0 * c + b), -0.5, 0.5);
}

/// A sinusoid's power in the bins of the lobe: sum over them of |X|^2 is A^2/4 sum(w)^2 (1 + 2/4) for Hann.
double amplitude_of(const Spectrum& spectrum, std::size_t k, double floor, std::size_t length) {
  double power = 0.0;
  for (std::size_t i = k - kLobe; i <= std::min(k + kLobe, spectrum.power.size() - 1); ++i)
    power += spectrum.power[i] - floor;
  const double sum_of_window_squared = 0.25 * static_cast<double>(length) * static_cast<double>(length);
  constexpr double kLobePower = 1.5;
  return std::sqrt(std::max(0.0, 4.0 * power / (kLobePower * sum_of_window_squared)));
}

double variance_of(std::span<const double> x, const std::vector<Segment>& runs) {
  double mean = 0.0;
  double squares = 0.0;
  double n = 0.0;
  for (const auto& run : runs) {
    for (std::size_t i = run.begin; i < run.end; ++i) {
      n += 1.0;
      const double before = x[i] - mean;
      mean += before / n;
      squares += before * (x[i] - mean);
    }
  }
  return n > 1.0 ? squares / (n - 1.0) : 0.0;
}

/// Variance a sample of white noise with this floor: E|X|^2 = sigma^2 sum(w^2), sum(w^2) = 3/8 n.
double noise_variance_of(double floor, const LineOptions& options) {
  return floor / (0.375 * static_cast<double>(options.segment));
}

/// Half of the overlapping segments are new.
double independent_segments(const Spectrum& spectrum) {
  return std::max(1.0, 0.5 * static_cast<double>(spectrum.segments));
}

/// Cramer and Rao's bound for one segment, averaged over them (independent phases).
double frequency_sd_hz(double amplitude, double floor, const Spectrum& spectrum, const LineOptions& options) {
  const auto length = static_cast<double>(options.segment);
  const double var_omega =
      24.0 * noise_variance_of(floor, options) / (amplitude * amplitude * length * length * length);
  return std::sqrt(var_omega / independent_segments(spectrum)) * options.rate_hz / (2.0 * std::numbers::pi);
}

/// The same bound, 2 sigma^2 / n, times what the window gives away (its equivalent noise bandwidth, 3/2
/// bins).
double amplitude_sd_of(double floor, const Spectrum& spectrum, const LineOptions& options) {
  constexpr double kBandwidth = 1.5;
  return std::sqrt(2.0 * kBandwidth * noise_variance_of(floor, options) /
                   static_cast<double>(options.segment) / independent_segments(spectrum));
}

std::vector<Segment> runs_of(std::span<const double> x, std::span<const std::uint8_t> mask,
                             std::size_t shortest) {
  auto runs = valid_segments(x, mask);
  std::erase_if(runs, [&](const Segment& run) { return run.end - run.begin < shortest; });
  return runs;
}

}  // namespace

std::vector<Line> find_lines(std::span<const double> x, std::span<const std::uint8_t> mask,
                             const LineOptions& options) {
  const auto runs = runs_of(x, mask, options.segment);
  if (runs.empty()) return {};
  const Spectrum spectrum = spectrum_of(x, runs, options.segment);
  const double dof = degrees_of_freedom(static_cast<double>(spectrum.segments));
  const boost::math::chi_squared chi(dof);
  const std::size_t last = spectrum.power.size() - 1 - kLobe;
  const std::size_t first = std::max(options.first_bin, kLobe + kFloorBins + 1);
  const auto bins = static_cast<double>(last - first + 1);
  // The floor is itself a median of some bins: its spread widens the threshold (variance of a median, pi/2
  // times that of a mean of as many).
  const double floor_spread =
      1.0 + 3.0 * std::sqrt(0.5 * std::numbers::pi * 2.0 / (dof * static_cast<double>(2 * kFloorBins)));
  const double threshold =
      floor_spread * boost::math::quantile(boost::math::complement(chi, options.false_alarm / bins)) / dof;
  const double total = variance_of(x, runs);

  std::vector<Line> lines;
  for (std::size_t k = first; k <= last; ++k) {
    const double power = spectrum.power[k];
    if (power < spectrum.power[k - 1] || power <= spectrum.power[k + 1]) continue;
    const double floor = floor_at(spectrum, k, dof);
    if (!(floor > 0.0) || power < threshold * floor) continue;
    if (power < threshold * power_beside(spectrum, k)) continue;
    Line line;
    const double offset = offset_of(spectrum.power[k - 1] - floor, power, spectrum.power[k + 1] - floor);
    line.frequency_hz =
        (static_cast<double>(k) + offset) * options.rate_hz / static_cast<double>(options.segment);
    line.amplitude = amplitude_of(spectrum, k, floor, options.segment);
    if (!(line.amplitude > 0.0)) continue;
    line.frequency_sd_hz = frequency_sd_hz(line.amplitude, floor, spectrum, options);
    line.amplitude_sd = amplitude_sd_of(floor, spectrum, options);
    line.share_of_variance = total > 0.0 ? 0.5 * line.amplitude * line.amplitude / total : 0.0;
    line.p_value = std::min(
        1.0, bins * boost::math::cdf(boost::math::complement(chi, dof * power / (floor * floor_spread))));
    lines.push_back(line);
  }
  std::sort(lines.begin(), lines.end(),
            [](const Line& a, const Line& b) { return a.amplitude > b.amplitude; });
  if (lines.size() > options.most_lines) lines.resize(options.most_lines);
  return lines;
}

double line_wv(const Line& line, double rate_hz, int level) {
  Shape shape{};
  shape[0] = 2.0 * std::numbers::pi * line.frequency_hz / rate_hz;
  return line.amplitude * line.amplitude * unit_wv(ProcessKind::kSinusoid, shape, level).value;
}

void remove_lines(std::span<double> x, std::span<const std::uint8_t> mask, const std::vector<Line>& lines,
                  const LineOptions& options) {
  if (lines.empty()) return;
  // Shorter pieces would lose too much of their noise to the sinusoids.
  const std::size_t shortest = options.segment / 4;
  const auto columns = static_cast<Eigen::Index>(2 * lines.size());
  for (const auto& run : runs_of(x, mask, shortest)) {
    for (std::size_t begin = run.begin; begin < run.end;) {
      const std::size_t left = run.end - begin;
      const std::size_t length = left < options.segment + shortest ? left : options.segment;
      const auto rows = static_cast<Eigen::Index>(length);
      Eigen::MatrixXd waves(rows, columns);
      for (std::size_t l = 0; l < lines.size(); ++l) {
        const double omega = 2.0 * std::numbers::pi * lines[l].frequency_hz / options.rate_hz;
        for (Eigen::Index i = 0; i < rows; ++i) {
          waves(i, static_cast<Eigen::Index>(2 * l)) = std::cos(omega * static_cast<double>(i));
          waves(i, static_cast<Eigen::Index>(2 * l + 1)) = std::sin(omega * static_cast<double>(i));
        }
      }
      Eigen::Map<Eigen::VectorXd> piece(x.data() + begin, rows);
      const double mean = piece.mean();
      const Eigen::VectorXd right = waves.transpose() * (piece.array() - mean).matrix();
      piece -= waves * (waves.transpose() * waves).eval().ldlt().solve(right);
      begin += length;
    }
  }
}

}  // namespace imuscope::noise
