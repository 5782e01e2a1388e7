#include "estimation/alignment/cross_correlation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <fmt/format.h>

namespace imuscope {

namespace {

constexpr double kFineStep_s = 0.01;
/// The whole search is made on averages of this many fine steps; only the peak is looked at finely.
constexpr std::size_t kFinePerCoarse = 10;
/// Vibration above some 5 Hz is not common to two mountings.
constexpr std::size_t kSmoothing = 9;
constexpr double kOverlapMin_s = 10.0;
/// |omega| must vary by this much to carry time information (0.3 deg/s).
constexpr double kMotionMin_radps = 0.005;
constexpr double kPeakCorrelationMin = 0.3;
constexpr double kDistinctnessMin = 1.05;
// Live, a wrong answer costs more than a late one: an idling engine correlates with itself at many lags, and
// a filter that begins there has to begin again.
constexpr double kLiveCorrelationMin = 0.7;
constexpr double kLiveDistinctnessMin = 1.2;
constexpr double kSegment_s = 30.0;
constexpr std::size_t kSegmentsMinForClockRate = 4;
constexpr double kSegmentSearch_s = 0.5;

struct Moments {
  double n = 0.0, a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;
  [[nodiscard]] double correlation() const noexcept {
    const double va = aa - a * a / n;
    const double vb = bb - b * b / n;
    if (!(va > 0.0) || !(vb > 0.0)) return 0.0;
    return (ab - a * b / n) / std::sqrt(va * vb);
  }
};

/// normalised correlation of a[i + lag] with b[i] where both exist. NaN marks missing values.
double correlation_at(std::span<const double> a, std::span<const double> b, std::int64_t lag,
                      std::size_t overlap_min) noexcept {
  const auto na = static_cast<std::int64_t>(a.size());
  const auto nb = static_cast<std::int64_t>(b.size());
  const std::int64_t first = std::max<std::int64_t>(0, -lag);
  const std::int64_t last = std::min(nb, na - lag);
  Moments m;
  for (std::int64_t i = first; i < last; ++i) {
    const double x = a[static_cast<std::size_t>(i + lag)];
    const double y = b[static_cast<std::size_t>(i)];
    if (std::isnan(x) || std::isnan(y)) continue;
    m.n += 1.0;
    m.a += x;
    m.b += y;
    m.aa += x * x;
    m.bb += y * y;
    m.ab += x * y;
  }
  if (m.n < static_cast<double>(overlap_min)) return 0.0;
  return m.correlation();
}

/// top of the parabola through three equally spaced values, in steps from the middle one, which is the highest:
/// half a step at most.
double parabola_top(double left, double middle, double right) noexcept {
  const double bend = left - 2.0 * middle + right;
  return bend < 0.0 ? 0.5 * (left - right) / bend : 0.0;
}

/// Peak over the highest value that is not on the same hill (the hill ends where half the peak is reached).
double distinctness_of(std::span<const double> correlation, std::size_t peak) noexcept {
  std::size_t low = peak;
  std::size_t high = peak;
  const double half = 0.5 * correlation[peak];
  while (low > 0 && correlation[low] > half) --low;
  while (high + 1 < correlation.size() && correlation[high] > half) ++high;
  double other = 0.0;
  for (std::size_t i = 0; i < low; ++i) other = std::max(other, correlation[i]);
  for (std::size_t i = high + 1; i < correlation.size(); ++i) other = std::max(other, correlation[i]);
  return other > 0.0 ? correlation[peak] / other : std::numeric_limits<double>::infinity();
}

/// A series on an even grid; NaN where the series has a hole.
struct Grid {
  double start_s = 0.0;
  double step_s = 0.0;
  std::vector<double> values;
};

Grid on_grid(const RateMagnitudeSeries& series, double step_s) {
  constexpr double kHole_s = 0.1;
  Grid grid{series.time_s.front(), step_s, {}};
  const double duration_s = series.time_s.back() - series.time_s.front();
  grid.values.resize(static_cast<std::size_t>(duration_s / step_s) + 1,
                     std::numeric_limits<double>::quiet_NaN());
  std::size_t j = 0;
  for (std::size_t i = 0; i < grid.values.size(); ++i) {
    const double t = grid.start_s + step_s * static_cast<double>(i);
    while (j + 2 < series.time_s.size() && series.time_s[j + 1] <= t) ++j;
    const double span_s = series.time_s[j + 1] - series.time_s[j];
    if (!(span_s > 0.0) || span_s > kHole_s) continue;
    const double share = (t - series.time_s[j]) / span_s;
    grid.values[i] = series.rate_radps[j] + share * (series.rate_radps[j + 1] - series.rate_radps[j]);
  }
  return grid;
}

/// Centred moving average of `width` (odd) values, so that no delay arises.
void smooth(std::vector<double>& values, std::size_t width) {
  const std::vector<double> raw = values;
  const std::size_t half = width / 2;
  for (std::size_t i = half; i + half < raw.size(); ++i) {
    double sum = 0.0;
    for (std::size_t k = i - half; k <= i + half; ++k) sum += raw[k];
    values[i] = sum / static_cast<double>(width);
  }
}

Grid coarsened(const Grid& fine, std::size_t factor) {
  // Centre of the averaged values, so that both series keep their time.
  Grid out{fine.start_s + 0.5 * static_cast<double>(factor - 1) * fine.step_s,
           fine.step_s * static_cast<double>(factor),
           {}};
  for (std::size_t i = 0; i + factor <= fine.values.size(); i += factor) {
    double sum = 0.0;
    for (std::size_t k = 0; k < factor; ++k) sum += fine.values[i + k];
    out.values.push_back(sum / static_cast<double>(factor));
  }
  return out;
}

double standard_deviation(std::span<const double> values) noexcept {
  Moments m;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    m.n += 1.0;
    m.a += v;
    m.aa += v * v;
  }
  return m.n > 1.0 ? std::sqrt(std::max(0.0, m.aa / m.n - m.a * m.a / (m.n * m.n))) : 0.0;
}

/// Lag (in s, added to the study's time) with the highest correlation within centre +- search.
struct Peak {
  double offset_s = 0.0;
  double correlation = 0.0;
  double distinctness = 0.0;
  bool inside = false;  ///< not at the edge of the search
};

Peak search(const Grid& reference, std::span<const double> study, double study_start_s, double centre_s,
            double search_s, double overlap_min_s) {
  const double step = reference.step_s;
  // lag in steps: study index i at study_start + i step, plus the offset, is reference index i + lag.
  const double base = (study_start_s + centre_s - reference.start_s) / step;
  const auto first = static_cast<std::int64_t>(std::ceil(base - search_s / step));
  const auto last = static_cast<std::int64_t>(std::floor(base + search_s / step));
  std::vector<double> correlation;
  for (std::int64_t lag = first; lag <= last; ++lag) {
    correlation.push_back(
        correlation_at(reference.values, study, lag, static_cast<std::size_t>(overlap_min_s / step)));
  }
  Peak out;
  if (correlation.empty()) return out;
  const auto top = std::max_element(correlation.begin(), correlation.end());
  const auto k = static_cast<std::size_t>(top - correlation.begin());
  out.correlation = *top;
  out.distinctness = distinctness_of(correlation, k);
  out.inside = k > 0 && k + 1 < correlation.size();
  const double fraction =
      out.inside ? parabola_top(correlation[k - 1], correlation[k], correlation[k + 1]) : 0.0;
  const double lag = static_cast<double>(first + static_cast<std::int64_t>(k)) + fraction;
  out.offset_s = reference.start_s + lag * step - study_start_s;
  return out;
}

/// straight line through the segments' offsets, robust against segments without motion, which come with
/// little weight.
struct SegmentOffset {
  double time_s;  ///< middle, study time
  double offset_s;
  double weight;
};

struct Line {
  double offset_s;  ///< at origin
  double slope;
  double offset_sd_s;
};

Line fit_line(const std::vector<SegmentOffset>& segments, double origin_s, bool with_slope) {
  double w = 0.0, t = 0.0, y = 0.0, tt = 0.0, ty = 0.0;
  for (const SegmentOffset& s : segments) {
    const double x = s.time_s - origin_s;
    w += s.weight;
    t += s.weight * x;
    y += s.weight * s.offset_s;
    tt += s.weight * x * x;
    ty += s.weight * x * s.offset_s;
  }
  const double determinant = w * tt - t * t;
  Line line{y / w, 0.0, 0.0};
  if (with_slope) line = {(tt * y - t * ty) / determinant, (w * ty - t * y) / determinant, 0.0};
  double residual = 0.0;
  for (const SegmentOffset& s : segments) {
    const double e = s.offset_s - line.offset_s - line.slope * (s.time_s - origin_s);
    residual += s.weight * e * e;
  }
  const double freedom = static_cast<double>(segments.size()) - (with_slope ? 2.0 : 1.0);
  const double variance = residual / w * static_cast<double>(segments.size()) / std::max(1.0, freedom);
  const double gain = with_slope ? w * tt / determinant : 1.0;
  line.offset_sd_s = std::sqrt(variance * gain / static_cast<double>(segments.size()));
  return line;
}

std::vector<SegmentOffset> segment_offsets(const Grid& reference, const Grid& study, double offset_s) {
  std::vector<SegmentOffset> out;
  const auto length = static_cast<std::size_t>(kSegment_s / study.step_s);
  for (std::size_t i = 0; i + length <= study.values.size(); i += length) {
    const std::span<const double> part(study.values.data() + i, length);
    const double start_s = study.start_s + study.step_s * static_cast<double>(i);
    const double motion = standard_deviation(part);
    if (motion < kMotionMin_radps) continue;
    const Peak peak = search(reference, part, start_s, offset_s, kSegmentSearch_s, kOverlapMin_s);
    if (!peak.inside || peak.correlation < kPeakCorrelationMin) continue;
    // Time information: motion against what does not correlate.
    const double noise = 1.0 - peak.correlation * peak.correlation + 1e-3;
    out.push_back({start_s + 0.5 * kSegment_s, peak.offset_s, motion * motion / noise});
  }
  return out;
}

}  // namespace

Result<TimeOffset> find_time_offset(const RateMagnitudeSeries& reference, const RateMagnitudeSeries& study,
                                    const TimeOffsetOptions& options) {
  for (const RateMagnitudeSeries* series : {&reference, &study}) {
    if (series->time_s.size() != series->rate_radps.size() || series->time_s.size() < 2 ||
        series->time_s.back() - series->time_s.front() < kOverlapMin_s) {
      return work_error(fmt::format("time offset: a series is shorter than {} s", kOverlapMin_s),
                        "record at least half a minute with turns");
    }
  }
  Grid fine_reference = on_grid(reference, kFineStep_s);
  Grid fine_study = on_grid(study, kFineStep_s);
  smooth(fine_reference.values, kSmoothing);
  smooth(fine_study.values, kSmoothing);
  const double motion =
      std::min(standard_deviation(fine_reference.values), standard_deviation(fine_study.values));
  if (motion < kMotionMin_radps) {
    return work_error(
        fmt::format("time offset: |angular rate| varies by {:.2g} rad/s only, {:.2g} are needed", motion,
                    kMotionMin_radps),
        "use a part of the recording with turns");
  }

  // everywhere coarsely, then at the peak finely.
  const Grid coarse_reference = coarsened(fine_reference, kFinePerCoarse);
  const Grid coarse_study = coarsened(fine_study, kFinePerCoarse);
  const Peak coarse = search(coarse_reference, coarse_study.values, coarse_study.start_s, 0.0,
                             options.search_s, kOverlapMin_s);
  if (coarse.correlation < kPeakCorrelationMin || coarse.distinctness < kDistinctnessMin || !coarse.inside) {
    return work_error(
        fmt::format(
            "time offset: no clear match within +-{} s (best correlation {:.2f}, {:.2f} times the next best)",
            options.search_s, coarse.correlation, coarse.distinctness),
        "check that both IMUs were on the same body, or search wider");
  }
  const double around_s = 2.0 * coarse_reference.step_s;
  const Peak fine =
      search(fine_reference, fine_study.values, fine_study.start_s, coarse.offset_s, around_s, kOverlapMin_s);

  TimeOffset out;
  out.study_origin_s = study.time_s.front();
  out.offset_s = fine.offset_s;
  out.correlation = fine.correlation;
  out.distinctness = coarse.distinctness;
  const std::vector<SegmentOffset> segments = segment_offsets(fine_reference, fine_study, fine.offset_s);
  if (segments.size() >= kSegmentsMinForClockRate && options.estimate_clock_rate) {
    const Line line = fit_line(segments, out.study_origin_s, true);
    out.offset_s = line.offset_s;
    out.clock_rate = line.slope;
    out.sd_s = line.offset_sd_s;
    out.clock_rate_estimated = true;
  } else if (segments.size() >= 2) {
    out.sd_s = fit_line(segments, out.study_origin_s, false).offset_sd_s;
  } else {
    out.sd_s = kFineStep_s;
  }
  return out;
}

void LiveTimeOffset::Stream::add(HostTime t, double r) noexcept {
  constexpr Duration kSpacingMin{8'000'000};
  if (!std::isfinite(r) || (count > 0 && t - newest() < kSpacingMin)) return;
  time[count % kSamples] = t;
  rate[count % kSamples] = r;
  ++count;
}

HostTime LiveTimeOffset::Stream::newest() const noexcept { return time[(count - 1) % kSamples]; }

bool LiveTimeOffset::Stream::sample_onto(HostTime start, Duration step,
                                         std::span<double> grid) const noexcept {
  constexpr double kHole_s = 0.1;
  if (count < 2) return false;
  std::size_t j = count > kSamples ? count - kSamples : 0;
  if (time[j % kSamples] > start) return false;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const HostTime t = start + step * static_cast<std::int64_t>(i);
    while (j + 1 < count && time[(j + 1) % kSamples] < t) ++j;
    if (j + 1 >= count) return false;
    const double span_s = to_seconds(time[(j + 1) % kSamples] - time[j % kSamples]);
    if (span_s > kHole_s) return false;
    const double share = to_seconds(t - time[j % kSamples]) / span_s;
    grid[i] = rate[j % kSamples] + share * (rate[(j + 1) % kSamples] - rate[j % kSamples]);
  }
  return true;
}

bool LiveTimeOffset::estimate(TimeOffset& out) noexcept {
  constexpr Duration kStep{20'000'000};
  constexpr double kStep_s = 0.02;
  if (reference_.count == 0 || study_.count == 0) return false;
  const HostTime end = std::min(reference_.newest(), study_.newest());
  const HostTime study_start = end - kStep * static_cast<std::int64_t>(kGridSize + kMaxLag);
  const HostTime reference_start = study_start - kStep * static_cast<std::int64_t>(kMaxLag);
  if (!reference_.sample_onto(reference_start, kStep, reference_grid_)) return false;
  if (!study_.sample_onto(study_start, kStep, study_grid_)) return false;
  if (standard_deviation(study_grid_) < kMotionMin_radps) return false;
  for (std::size_t lag = 0; lag < correlation_.size(); ++lag) {
    correlation_[lag] =
        correlation_at(reference_grid_, study_grid_, static_cast<std::int64_t>(lag), study_grid_.size());
  }
  const auto k = static_cast<std::size_t>(std::max_element(correlation_.begin(), correlation_.end()) -
                                          correlation_.begin());
  if (k == 0 || k + 1 == correlation_.size()) return false;
  const double distinctness = distinctness_of(correlation_, k);
  if (correlation_[k] < kLiveCorrelationMin || distinctness < kLiveDistinctnessMin) return false;
  const double top = parabola_top(correlation_[k - 1], correlation_[k], correlation_[k + 1]);
  out = TimeOffset{};
  out.offset_s = (static_cast<double>(k) + top - static_cast<double>(kMaxLag)) * kStep_s;
  out.correlation = correlation_[k];
  out.distinctness = distinctness;
  // sd of a peak: noise over the bend of the correlation.
  const double bend =
      -(correlation_[k - 1] - 2.0 * correlation_[k] + correlation_[k + 1]) / (kStep_s * kStep_s);
  const double noise = 1.0 - correlation_[k] * correlation_[k];
  out.sd_s = std::sqrt(noise / (static_cast<double>(kGridSize) * std::max(bend, 1e-6)));
  return true;
}

}  // namespace imuscope
