#include "sample/clock_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/contracts.h"

namespace imuscope {
namespace {

// Interval of device time that leaves one point (its lowest). 256 of them span 8.5 minutes: long enough to
// see the bottom of the 1 ms saw-tooth that USB frames make at a skew of 5 ppm (200 s), short enough for a
// crystal that warms up.
constexpr double kBin_s = 2.0;
// A rate is fitted when the closed intervals span this much; before, the rate of the segment before is kept.
constexpr std::size_t kBinsForRate = 5;
// Intervals whose lowest point is this far above the envelope saw nothing but late bytes. USB frames take 1
// ms.
constexpr double kEnvelope_s = 0.002;
// How far the rate may have wandered: old points are lifted by half of this times age squared, so that a
// crystal that warms up is followed and old points bind less than new ones.
constexpr double kRateWander_per_s = 1e-9;

// A point this far below a settled line cannot be explained by delay or by an unknown rate (crystals: 200
// ppm).
constexpr double kEarlyAllowance_s = 0.020;
constexpr double kRateAllowance = 200e-6;
constexpr double kSettled_s = 10.0;
constexpr int kEarlyToRestart = 3;
constexpr Duration kWrongDeviceTime = std::chrono::seconds{1};
// Every observation later than the line by this much for this long, in device time and in host time, and no
// less late as time goes on: the device's clock jumped. What waited while the host was away comes in a burst,
// in no host time to speak of, or is caught up with: ever less late. Nothing is learned from it meanwhile.
constexpr double kLate_s = 0.050;
constexpr double kLateToRestart_s = 10.0;

// A correction decays with a time constant that grows with the segment's age between these.
constexpr double kCorrectionMin_s = 0.2;
constexpr double kCorrectionMax_s = 10.0;
constexpr double kCorrectionPerAge = 0.1;
// The mapped time runs at least at this fraction of the device's rate.
constexpr double kSlowest = 0.5;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

// Nearest nanosecond; from_seconds() without the library call, as this runs for every sample.
Duration duration(double value_s) {
  return Duration{static_cast<std::int64_t>(value_s * 1e9 + std::copysign(0.5, value_s))};
}

}  // namespace

ClockMap::ClockMap(const ClockMapConfig& config) noexcept : config_(config) {
  IMUSCOPE_EXPECTS(config.rate_ratio > 0.9 && config.rate_ratio < 1.1);
}

// Inline: what runs for every sample.
inline void ClockMap::move_line(const Line& line, double x_s) noexcept {
  correction_s_ += line_.at(x_s) - line.at(x_s);
  line_ = line;
}

inline bool ClockMap::jumped(const Point& point, double residual_s) noexcept {
  const double host_s = point.x_s + point.y_s;
  const double unseen_s = point.x_s - seconds(last_device_ns_ - device_origin_ns_);
  const bool settled = std::min(point.x_s, host_s) > kSettled_s;
  const bool early = settled && residual_s < -(kEarlyAllowance_s + kRateAllowance * unseen_s);
  early_in_a_row_ = early ? early_in_a_row_ + 1 : 0;
  if (early_in_a_row_ >= kEarlyToRestart) return true;
  if (residual_s < kLate_s) {
    late_ = false;
    return false;
  }
  if (!late_ || residual_s < late_by_s_ - kLate_s) {
    late_since_s_ = point.x_s;
    late_since_host_s_ = host_s;
    late_by_s_ = residual_s;
  }
  late_ = true;
  return std::min(point.x_s - late_since_s_, host_s - late_since_host_s_) > kLateToRestart_s;
}

inline void ClockMap::take(const Point& point) noexcept {
  if (point.x_s - open_bin_start_s_ >= kBin_s) {
    close_bin();
    refit();
    open_bin_start_s_ = kBin_s * std::floor(point.x_s / kBin_s);
  }
  const double residual_s = point.y_s - line_.at(point.x_s);
  if (open_bin_empty_ || residual_s < open_bin_.y_s - line_.at(open_bin_.x_s)) open_bin_ = point;
  open_bin_empty_ = false;
  // The envelope never lies above an observation.
  if (residual_s < 0.0) move_line({line_.a_s + residual_s, line_.b}, point.x_s);
}

inline HostTime ClockMap::emit(std::int64_t device_time_ns, double x_s, HostTime first_byte) noexcept {
  if (has_last_ && device_time_ns == last_device_ns_) return last_mapped_;
  const bool continues = has_last_ && device_time_ns > last_device_ns_;
  const double step_s = continues ? seconds(device_time_ns - last_device_ns_) : 0.0;
  const double tau_s = std::clamp(kCorrectionPerAge * x_s, kCorrectionMin_s, kCorrectionMax_s);
  correction_s_ *= tau_s / (tau_s + step_s);

  const Duration since_origin{device_time_ns - device_origin_ns_};
  HostTime mapped = host_origin_ + since_origin + duration(line_.at(x_s) + correction_s_);
  // Nothing is sampled a second after it arrived: not the stamp but the device time is wrong.
  const bool believed = early_in_a_row_ == 0 || mapped - first_byte < kWrongDeviceTime;
  if (!believed) mapped = std::min(mapped, first_byte);
  if (has_last_) {
    const Duration slowest = believed ? duration(kSlowest * step_s) : Duration{1};
    mapped = std::max(mapped, last_mapped_ + std::max(Duration{1}, slowest));
  }
  has_last_ = true;
  last_device_ns_ = device_time_ns;
  last_mapped_ = mapped;
  return mapped;
}

HostTime ClockMap::observe(std::int64_t device_time_ns, HostTime first_byte) noexcept {
  if (is_fixed()) {
    // Whole nanoseconds plus the small rest, so that days of device time keep their nanoseconds.
    const double rest_ns = (config_.rate_ratio - 1.0) * static_cast<double>(device_time_ns);
    return config_.origin + Duration{device_time_ns + std::llround(rest_ns)};
  }
  if (in_segment_ && device_time_ns < last_device_ns_) restart();
  if (!in_segment_) begin_segment(device_time_ns, first_byte);

  const std::int64_t since_origin_ns = device_time_ns - device_origin_ns_;
  Point point{seconds(since_origin_ns), seconds((first_byte - host_origin_).count() - since_origin_ns)};
  if (jumped(point, point.y_s - line_.at(point.x_s))) {
    restart();
    begin_segment(device_time_ns, first_byte);
    point = {0.0, 0.0};
  }
  if (early_in_a_row_ == 0 && !late_) take(point);
  return emit(device_time_ns, point.x_s, first_byte);
}

void ClockMap::restart() noexcept {
  if (!in_segment_) return;
  in_segment_ = false;
  ++restarts_;
}

double ClockMap::drift_ppm() const noexcept {
  const double host_per_device = is_fixed() ? config_.rate_ratio : 1.0 + line_.b;
  return (1.0 / host_per_device - 1.0) * 1e6;
}

void ClockMap::begin_segment(std::int64_t device_time_ns, HostTime first_byte) noexcept {
  in_segment_ = true;
  device_origin_ns_ = device_time_ns;
  host_origin_ = first_byte;
  line_.a_s = 0.0;
  scatter_s_ = std::numeric_limits<double>::quiet_NaN();
  correction_s_ = 0.0;
  bins_begin_ = 0;
  bins_count_ = 0;
  open_bin_start_s_ = 0.0;
  open_bin_empty_ = true;
  early_in_a_row_ = 0;
  late_ = false;
}

void ClockMap::close_bin() noexcept {
  if (bins_count_ == kBins) {
    bins_begin_ = (bins_begin_ + 1) % kBins;
    --bins_count_;
  }
  bins_[(bins_begin_ + bins_count_) % kBins] = open_bin_;
  ++bins_count_;
  open_bin_empty_ = true;
}

// The rate in two steps. First the line below all points that is closest to them in the mean: the edge of
// their lower convex hull that spans their mean time. It is blind to stalls, but where the envelope itself
// moves (USB frames beat against the samples) it hangs on few points. So then the points that are near it are
// fitted by least squares. The line with that rate is laid below all points.
void ClockMap::refit() noexcept {
  if (bins_count_ < kBinsForRate) return;
  const double newest_s = bin(bins_count_ - 1).x_s;
  std::array<Point, kBins> hull;
  const std::size_t n = lower_hull(hull);
  const double b = std::clamp(rate_near(hull_edge(hull, n)), -kRateAllowance, kRateAllowance);
  double a_s = hull[0].y_s - b * hull[0].x_s;
  for (std::size_t i = 1; i < n; ++i) a_s = std::min(a_s, hull[i].y_s - b * hull[i].x_s);
  scatter_s_ = scatter_about({a_s, b});
  move_line({a_s, b}, newest_s);
}

// Of the points that the rate is fitted to: those no more than kEnvelope_s above the line.
double ClockMap::scatter_about(const Line& line) const noexcept {
  double count = 0.0;
  double mean = 0.0;
  double sum_of_squares = 0.0;
  for (std::size_t i = 0; i < bins_count_; ++i) {
    const double r = bin(i).y_s - line.at(bin(i).x_s);
    if (r > kEnvelope_s) continue;
    count += 1.0;
    const double step = r - mean;
    mean += step / count;
    sum_of_squares += step * (r - mean);
  }
  return count > 1.0 ? std::sqrt(sum_of_squares / (count - 1.0)) : std::numeric_limits<double>::quiet_NaN();
}

// Vertices from left to right; there are at least two. Old points are lifted, so that they bind less.
std::size_t ClockMap::lower_hull(std::array<Point, kBins>& hull) const noexcept {
  const double newest_s = bin(bins_count_ - 1).x_s;
  std::size_t n = 0;
  for (std::size_t i = 0; i < bins_count_; ++i) {
    Point p = bin(i);
    const double age_s = newest_s - p.x_s;
    p.y_s += 0.5 * kRateWander_per_s * age_s * age_s;
    // Drop the last vertex while it lies on or above the chord from the one before it to p.
    while (n >= 2 && (hull[n - 1].y_s - hull[n - 2].y_s) * (p.x_s - hull[n - 2].x_s) >=
                         (p.y_s - hull[n - 2].y_s) * (hull[n - 1].x_s - hull[n - 2].x_s)) {
      --n;
    }
    hull[n++] = p;
  }
  return n;
}

ClockMap::Line ClockMap::hull_edge(const std::array<Point, kBins>& hull, std::size_t n) const noexcept {
  double sum_x_s = 0.0;
  for (std::size_t i = 0; i < bins_count_; ++i) sum_x_s += bin(i).x_s;
  const double mean_s = sum_x_s / static_cast<double>(bins_count_);
  std::size_t right = 1;
  while (right + 1 < n && hull[right].x_s < mean_s) ++right;
  const Point& p = hull[right - 1];
  const Point& q = hull[right];
  const double b = (q.y_s - p.y_s) / (q.x_s - p.x_s);
  return {p.y_s - b * p.x_s, b};
}

// Least squares over the points that are no more than kEnvelope_s above the line.
double ClockMap::rate_near(const Line& line) const noexcept {
  double count = 0.0;
  double sum_x = 0.0;
  double sum_r = 0.0;
  double sum_xx = 0.0;
  double sum_xr = 0.0;
  const double middle_s = bin(bins_count_ / 2).x_s;
  for (std::size_t i = 0; i < bins_count_; ++i) {
    const Point& p = bin(i);
    const double r = p.y_s - line.at(p.x_s);
    if (r > kEnvelope_s) continue;
    const double x = p.x_s - middle_s;
    count += 1.0;
    sum_x += x;
    sum_r += r;
    sum_xx += x * x;
    sum_xr += x * r;
  }
  const double spread = count * sum_xx - sum_x * sum_x;
  return spread > 0.0 ? line.b + (count * sum_xr - sum_x * sum_r) / spread : line.b;
}

}  // namespace imuscope
