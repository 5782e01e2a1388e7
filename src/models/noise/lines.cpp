#include "models/noise/lines.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "models/noise/process.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {
namespace {

/// Half-width of the main lobe of a Hann window, in bins.
constexpr std::size_t kLobe = 2;
/// What may belong to a line, on either side of its peak: the lobe, and where a line that wanders leaks to.
constexpr std::size_t kBeside = kLobe + 6;
/// The noise beside a bin: so many bins to either side, outside of the lobe.
constexpr std::size_t kFloorBins = 40;
/// The first bin with a floor on both sides. Nearer to zero the noise of sensors rises within its floor.
constexpr std::size_t kFirstBin = kLobe + kFloorBins + 1;
/// From one length of segments to the next.
constexpr std::size_t kLonger = 4;
/// Fewer of a longer segment than these are one look at slow noise, not a spectrum.
constexpr std::size_t kFewestSegments = 3;
/// Median of bins [first, last), as a mean.
double median_power(const Spectrum& spectrum, std::size_t first, std::size_t last, double dof) {
  std::vector<double> bins(spectrum.power.begin() + static_cast<std::ptrdiff_t>(first),
                           spectrum.power.begin() + static_cast<std::ptrdiff_t>(last));
  const auto middle = bins.begin() + static_cast<std::ptrdiff_t>(bins.size() / 2);
  std::nth_element(bins.begin(), middle, bins.end());
  return *middle * dof / boost::math::quantile(boost::math::chi_squared(dof), 0.5);
}

/// G-23: power of the noise at bin k: the geometric mean of what is to its left and to its right, so that a slope
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
  double sum = 0.0;
  double n = 0.0;
  for (std::size_t d = kLobe + 1; d <= kBeside; ++d) {
    sum += spectrum.power[k - d];
    n += 1.0;
    if (k + d >= spectrum.power.size()) continue;
    sum += spectrum.power[k + d];
    n += 1.0;
  }
  return sum / n;
}

/// G-23: offset of a peak from its bin, for a Hann window: (b - a) / (a + 2 c + b) times 2 of the neighbours'
/// magnitudes (Grandke 1983 in symmetric form).
double offset_of(double left, double peak, double right) {
  const double a = std::sqrt(std::max(left, 0.0));
  const double c = std::sqrt(peak);
  const double b = std::sqrt(std::max(right, 0.0));
  return std::clamp(2.0 * (b - a) / (a + 2.0 * c + b), -0.5, 0.5);
}

/// A sinusoid's power in the bins of the lobe: sum over them of |X|^2 is A^2/4 sum(w)^2 (1 + 2/4) for Hann.
double amplitude_of(const Spectrum& spectrum, std::size_t k, double floor) {
  double power = 0.0;
  for (std::size_t i = k - kLobe; i <= std::min(k + kLobe, spectrum.power.size() - 1); ++i)
    power += spectrum.power[i] - floor;
  const double sum_of_window_squared =
      0.25 * static_cast<double>(spectrum.length) * static_cast<double>(spectrum.length);
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
double noise_variance_of(double floor, const Spectrum& spectrum) {
  return floor / (0.375 * static_cast<double>(spectrum.length));
}

/// Half of the overlapping segments are new.
double independent_segments(const Spectrum& spectrum) {
  return std::max(1.0, 0.5 * static_cast<double>(spectrum.segments));
}

/// G-23: Cramer and Rao's bound for one segment, averaged over them (independent phases).
double frequency_sd_hz(double amplitude, double floor, const Spectrum& spectrum, double rate_hz) {
  const auto length = static_cast<double>(spectrum.length);
  const double var_omega =
      24.0 * noise_variance_of(floor, spectrum) / (amplitude * amplitude * length * length * length);
  return std::sqrt(var_omega / independent_segments(spectrum)) * rate_hz / (2.0 * std::numbers::pi);
}

/// The same bound, 2 sigma^2 / n, times what the window gives away (its equivalent noise bandwidth, 3/2
/// bins).
double amplitude_sd_of(double floor, const Spectrum& spectrum) {
  constexpr double kBandwidth = 1.5;
  return std::sqrt(2.0 * kBandwidth * noise_variance_of(floor, spectrum) /
                   static_cast<double>(spectrum.length) / independent_segments(spectrum));
}

/// Bins [first, last] of one spectrum in which lines are looked for.
struct Band {
  const Spectrum& spectrum;
  std::size_t first;
  std::size_t last;
};

/// The bin of LineOptions::lowest_hz.
std::size_t lowest_bin(std::size_t length, const LineOptions& options) {
  const double bin_hz = options.rate_hz / static_cast<double>(length);
  return static_cast<std::size_t>(std::ceil(options.lowest_hz / bin_hz));
}

/// From the highest frequencies down.
std::vector<Band> bands_of(Spectra& spectra, const LineOptions& options) {
  std::vector<Band> bands;
  for (const std::size_t length : segments_of_lines(spectra, options)) {
    const Spectrum& spectrum = spectra.of(length);
    const std::size_t last = bands.empty() ? spectrum.power.size() - 1 - kLobe : kLonger * kFirstBin - 1;
    const std::size_t first = std::max(lowest_bin(length, options), kFirstBin);
    if (first <= last) bands.push_back({spectrum, first, last});
  }
  return bands;
}

/// Lines of one band.
class Search {
 public:
  /// @param bins   of all bands: each is a chance for noise
  /// @param total  variance of the signal
  Search(const Band& band, const LineOptions& options, double bins, double total)
      : band_(band),
        options_(options),
        bins_(bins),
        total_(total),
        dof_(degrees_of_freedom(static_cast<double>(band.spectrum.segments))),
        // The floor is itself a median of some bins: its spread widens the threshold (variance of a median,
        // pi/2 times that of a mean of as many).
        floor_spread_(1.0 + 3.0 * std::sqrt(0.5 * std::numbers::pi * 2.0 /
                                            (dof_ * static_cast<double>(2 * kFloorBins)))),
        // G-23: the bound
        threshold_(floor_spread_ *
                   boost::math::quantile(
                       boost::math::complement(boost::math::chi_squared(dof_), options.false_alarm / bins)) /
                   dof_) {}

  [[nodiscard]] std::vector<Line> lines() const {
    std::vector<Line> out;
    for (std::size_t k = band_.first; k <= band_.last; ++k) {
      if (auto line = at(k)) out.push_back(*line);
    }
    return out;
  }

 private:
  [[nodiscard]] std::optional<Line> at(std::size_t k) const {
    const Spectrum& spectrum = band_.spectrum;
    const double power = spectrum.power[k];
    if (power < spectrum.power[k - 1] || power <= spectrum.power[k + 1]) return std::nullopt;
    const double floor = floor_at(spectrum, k, dof_);
    if (!(floor > 0.0) || power < threshold_ * floor) return std::nullopt;
    if (power < threshold_ * power_beside(spectrum, k)) return std::nullopt;
    Line line;
    line.segment = spectrum.length;
    const double offset = offset_of(spectrum.power[k - 1] - floor, power, spectrum.power[k + 1] - floor);
    line.frequency_hz =
        (static_cast<double>(k) + offset) * options_.rate_hz / static_cast<double>(spectrum.length);
    line.amplitude = amplitude_of(spectrum, k, floor);
    if (!(line.amplitude > 0.0)) return std::nullopt;
    line.frequency_sd_hz = frequency_sd_hz(line.amplitude, floor, spectrum, options_.rate_hz);
    line.amplitude_sd = amplitude_sd_of(floor, spectrum);
    line.share_of_variance = total_ > 0.0 ? 0.5 * line.amplitude * line.amplitude / total_ : 0.0;
    line.p_value =
        std::min(1.0, bins_ * boost::math::cdf(boost::math::complement(
                                  boost::math::chi_squared(dof_), dof_ * power / (floor * floor_spread_))));
    return line;
  }

  const Band& band_;
  const LineOptions& options_;
  double bins_;
  double total_;
  double dof_;
  double floor_spread_;
  double threshold_;
};

/// A line at the border of two bands is one.
bool is_known(const std::vector<Line>& lines, const Line& line, double rate_hz) {
  return std::any_of(lines.begin(), lines.end(), [&](const Line& other) {
    const auto shorter = static_cast<double>(std::min(line.segment, other.segment));
    return std::abs(line.frequency_hz - other.frequency_hz) < static_cast<double>(kLobe) * rate_hz / shorter;
  });
}

/// G-23: sines and cosines of some lines over a block, and what least squares by them takes.
struct Waves {
  Eigen::MatrixXd columns;
  Eigen::LDLT<Eigen::MatrixXd> normal;
};

/// Takes lines that were found in segments of one length out of the blocks of a signal.
class LineRemover {
 public:
  LineRemover(const Present& present, std::span<const Line> lines, double rate_hz)
      : present_(present), lines_(lines), rate_hz_(rate_hz) {}

  /// Out of [begin, end), by those of its samples that are there.
  void remove_from(std::span<double> x, std::size_t begin, std::size_t end) {
    Eigen::VectorXd piece(static_cast<Eigen::Index>(present_.count(begin, end)));
    Eigen::Index row = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (present_.at(i)) piece[row++] = x[i];
    }
    const Waves& waves = waves_of(begin, end);
    const Eigen::VectorXd right = waves.columns.transpose() * (piece.array() - piece.mean()).matrix();
    piece -= waves.columns * waves.normal.solve(right);
    row = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (present_.at(i)) x[i] = piece[row++];
    }
  }

 private:
  /// All blocks of one length in which no sample is missing have the same.
  const Waves& waves_of(std::size_t begin, std::size_t end) {
    const bool is_whole = present_.count(begin, end) == end - begin;
    if (is_whole && end - begin == whole_length_) return *waves_;
    waves_.reset();  // long ones are not held twice
    waves_.emplace(waves_at(begin, end));
    whole_length_ = is_whole ? end - begin : 0;
    return *waves_;
  }

  [[nodiscard]] Waves waves_at(std::size_t begin, std::size_t end) const {
    Eigen::MatrixXd columns(static_cast<Eigen::Index>(present_.count(begin, end)),
                            static_cast<Eigen::Index>(2 * lines_.size()));
    Eigen::Index row = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (!present_.at(i)) continue;
      for (std::size_t l = 0; l < lines_.size(); ++l) {
        const double phase =
            2.0 * std::numbers::pi * lines_[l].frequency_hz / rate_hz_ * static_cast<double>(i - begin);
        columns(row, static_cast<Eigen::Index>(2 * l)) = std::cos(phase);
        columns(row, static_cast<Eigen::Index>(2 * l + 1)) = std::sin(phase);
      }
      ++row;
    }
    const Eigen::MatrixXd normal = columns.transpose() * columns;
    return {std::move(columns), normal.ldlt()};
  }

  const Present& present_;
  std::span<const Line> lines_;
  double rate_hz_;
  std::optional<Waves> waves_;
  std::size_t whole_length_ = 0;  ///< of the block that they belong to; 0: of one with missing samples
};

/// Runs joined over holes shorter than `hole`.
std::vector<Segment> joined(const std::vector<Segment>& runs, std::size_t hole) {
  std::vector<Segment> out;
  for (const Segment& run : runs) {
    if (!out.empty() && run.begin - out.back().end < hole)
      out.back().end = run.end;
    else
      out.push_back(run);
  }
  return out;
}

}  // namespace

std::vector<std::size_t> segments_of_lines(const Spectra& spectra, const LineOptions& options) {
  std::vector<std::size_t> lengths;
  for (std::size_t length = options.segment; length <= spectra.samples().size(); length *= kLonger) {
    const std::size_t fewest = lengths.empty() ? 1 : kFewestSegments;
    if (spectra.present().segments(length).size() < fewest) break;
    lengths.push_back(length);
    if (lowest_bin(length, options) >= kFirstBin) break;
  }
  return lengths;
}

std::vector<Line> find_lines(std::span<const double> x, std::span<const std::uint8_t> mask,
                             const LineOptions& options) {
  Spectra spectra(x, mask);
  return find_lines(spectra, options);
}

std::vector<Line> find_lines(Spectra& spectra, const LineOptions& options) {
  const std::vector<Band> bands = bands_of(spectra, options);
  double bins = 0.0;
  for (const Band& band : bands) bins += static_cast<double>(band.last - band.first + 1);
  const double total = bands.empty() ? 0.0 : variance_of(spectra.samples(), spectra.present().runs());
  std::vector<Line> lines;
  for (const Band& band : bands) {
    for (const Line& line : Search(band, options, bins, total).lines()) {
      if (!is_known(lines, line, options.rate_hz)) lines.push_back(line);
    }
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

namespace {

/// G-23: bins on either side of a line's peak that are not its neighbours' noise. Every bin that is put right costs the
/// variance what it knows of the noise there: the lobe alone, unless the line is seen beside it.
std::size_t reach_of(const Spectrum& without, std::size_t peak, double floor, double dof) {
  constexpr double kBeyondChance = 3.09;  // sd: one in a thousand
  // Bins of a Hann window share half of what they tell with their neighbours.
  const double bins = 2.0 * static_cast<double>(kBeside - kLobe) / 1.5;
  const double floor_bins = 2.0 * static_cast<double>(kFloorBins) / 1.5 / (0.5 * std::numbers::pi);
  const double sd = std::sqrt(2.0 / dof * (1.0 / bins + 1.0 / floor_bins));
  return power_beside(without, peak) > floor * (1.0 + kBeyondChance * sd) ? kBeside : kLobe;
}

/// Bins [first, last] of a line, and the noise's power there.
struct LineBins {
  std::size_t first;
  std::size_t last;
  double floor;
};

/// G-23: of two lines a bin belongs to the nearer.
/// @param peaks  in order
std::vector<LineBins> bins_of(const Spectrum& without, const std::vector<std::size_t>& peaks) {
  const double dof = degrees_of_freedom(static_cast<double>(without.segments));
  std::vector<LineBins> bins;
  for (std::size_t p = 0; p < peaks.size(); ++p) {
    const std::size_t peak = peaks[p];
    const double floor = floor_at(without, peak, dof);
    const std::size_t reach = reach_of(without, peak, floor, dof);
    const std::size_t first_own = p == 0 ? 0 : (peaks[p - 1] + peak) / 2 + 1;
    const std::size_t last_own = p + 1 == peaks.size() ? without.power.size() - 1 : (peak + peaks[p + 1]) / 2;
    bins.push_back({std::max(peak - reach, first_own), std::min(peak + reach, last_own), floor});
  }
  return bins;
}

}  // namespace

Remainders::Remainders(Spectra& without, const std::vector<Line>& lines, double rate_hz) {
  std::map<std::size_t, std::vector<std::size_t>, std::greater<>> peaks_of_segment;
  for (const Line& line : lines) {
    const double bin = line.frequency_hz / rate_hz * static_cast<double>(line.segment);
    peaks_of_segment[line.segment].push_back(static_cast<std::size_t>(std::lround(bin)));
  }
  // Long segments first: what they tell of a line, shorter ones of its neighbour would tell again.
  std::vector<std::pair<double, double>> told_rad;
  for (auto& [segment, peaks] : peaks_of_segment) {
    std::sort(peaks.begin(), peaks.end());
    const Spectrum& spectrum = without.of(segment);
    const double bin_hz = rate_hz / static_cast<double>(segment);
    const double bin_rad = 2.0 * std::numbers::pi / static_cast<double>(segment);
    const std::vector<LineBins> of_lines = bins_of(spectrum, peaks);
    for (const LineBins& of_line : of_lines) {
      for (std::size_t k = of_line.first; k <= of_line.last; ++k) {
        const double omega_rad = bin_rad * static_cast<double>(k);
        const bool is_told = std::any_of(told_rad.begin(), told_rad.end(), [&](const auto& band) {
          return omega_rad > band.first && omega_rad < band.second;
        });
        if (is_told || !(spectrum.power[k] > 0.0)) continue;
        const double share = 1.0 - of_line.floor / spectrum.power[k];
        bins_.push_back({omega_rad, share * density_at(spectrum, k, rate_hz) * bin_hz});
      }
    }
    for (const LineBins& of_line : of_lines) {
      told_rad.emplace_back(bin_rad * (static_cast<double>(of_line.first) - 0.5),
                            bin_rad * (static_cast<double>(of_line.last) + 0.5));
    }
  }
}

double Remainders::wv(double n) const {
  double sum = 0.0;
  for (const Bin& bin : bins_) sum += 2.0 * bin.variance * sinusoid_wv(bin.omega_rad, n);
  return sum;
}

double Remainders::taken_out_of(double variance, double n) const {
  return std::max(variance - wv(n), 0.5 * variance);
}

void Remainders::take_out_of(WaveletVariance& wv, double confidence) const {
  if (empty()) return;
  for (WvLevel& level : wv.levels) level.value = taken_out_of(level.value, 0.5 * level.tau_samples);
  set_intervals(wv.levels, wv.efficiency, confidence);
}

std::string in_words(const Line& line, std::string_view unit) {
  return fmt::format("a line at {:.4g} Hz, amplitude {:.3g} {} ({:.2g} % of the variance)", line.frequency_hz,
                     line.amplitude, unit, 100.0 * line.share_of_variance);
}

void remove_lines(std::span<double> x, std::span<const std::uint8_t> mask, const std::vector<Line>& lines,
                  double rate_hz) {
  if (lines.empty()) return;
  const Present present(x, mask);
  std::map<std::size_t, std::vector<Line>, std::greater<>> by_segment;
  for (const Line& line : lines) by_segment[line.segment].push_back(line);
  for (const auto& [segment, alike] : by_segment) {
    // Shorter pieces would lose too much of their noise to the sinusoids.
    const std::size_t shortest = segment / 4;
    LineRemover remover(present, alike, rate_hz);
    for (const Segment& stretch : joined(present.runs(), shortest)) {
      for (std::size_t begin = stretch.begin; begin < stretch.end;) {
        const std::size_t left = stretch.end - begin;
        const std::size_t length = left < segment + shortest ? left : segment;
        if (present.count(begin, begin + length) >= shortest) remover.remove_from(x, begin, begin + length);
        begin += length;
      }
    }
  }
}

}  // namespace imuscope::noise
