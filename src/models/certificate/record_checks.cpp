#include "models/certificate/record_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "models/certificate/axis_certificate.h"

namespace imuscope::certificate {
namespace {

/// Values looked at for their grid.
constexpr std::size_t kLookedAt = 20'000;

/// Least and highest value and how many samples have it.
struct Extremes {
  double low = 0.0;
  double high = 0.0;
  std::size_t at_low = 0;
  std::size_t at_high = 0;
  std::size_t longest_run = 0;  ///< neighbouring samples of one value
  std::size_t run_at = 0;
};

Extremes extremes_of(std::span<const double> x, std::span<const std::uint8_t> mask) {
  Extremes e;
  bool any = false;
  std::size_t run = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (mask[i] == 0) {
      run = 0;
      continue;
    }
    if (!any || x[i] < e.low) e.low = x[i], e.at_low = 0;
    if (!any || x[i] > e.high) e.high = x[i], e.at_high = 0;
    any = true;
    e.at_low += x[i] == e.low ? 1 : 0;
    e.at_high += x[i] == e.high ? 1 : 0;
    run = run > 0 && x[i] == x[i - 1] ? run + 1 : 1;
    if (run > e.longest_run) {
      e.longest_run = run;
      e.run_at = i + 1 - run;
    }
  }
  return e;
}

/// Samples within `reach` of a value; of no reach, none.
std::size_t count_near(std::span<const double> x, std::span<const std::uint8_t> mask, double value,
                       double reach) {
  std::size_t n = 0;
  for (std::size_t i = 0; i < x.size() && reach > 0.0; ++i)
    n += mask[i] != 0 && std::abs(x[i] - value) < reach ? 1 : 0;
  return n;
}

/// Sd of each second, or of so many samples that a tenth of them tells something.
struct Blocks {
  std::vector<double> mean;
  std::vector<double> sd;
  double seconds = 1.0;
};

Blocks blocks_of(double rate_hz, std::span<const double> x, std::span<const std::uint8_t> mask) {
  Blocks out;
  constexpr double kFewest = 20.0;
  out.seconds = std::max(1.0, kFewest / rate_hz);
  const auto length = static_cast<std::size_t>(out.seconds * rate_hz);
  for (std::size_t begin = 0; begin + length <= x.size(); begin += length) {
    double mean = 0.0;
    double squares = 0.0;
    double n = 0.0;
    for (std::size_t i = begin; i < begin + length; ++i) {
      if (mask[i] == 0) continue;
      n += 1.0;
      const double before = x[i] - mean;
      mean += before / n;
      squares += before * (x[i] - mean);
    }
    const bool enough = n >= 0.5 * static_cast<double>(length) && n > 2.0;
    out.mean.push_back(enough ? mean : std::nan(""));
    out.sd.push_back(enough ? std::sqrt(squares / (n - 1.0)) : std::nan(""));
  }
  return out;
}

double median_of(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Motion: seconds whose spread is many times that of the others, or whose mean leaps.
std::optional<std::string> motion_in(double rate_hz, std::span<const double> x,
                                     std::span<const std::uint8_t> mask) {
  constexpr double kTimes = 6.0;
  const Blocks blocks = blocks_of(rate_hz, x, mask);
  const double usual = median_of(blocks.sd);
  const double centre = median_of(blocks.mean);
  std::size_t n = 0;
  std::size_t first = 0;
  for (std::size_t i = 0; i < blocks.sd.size(); ++i) {
    const bool shaken = blocks.sd[i] > kTimes * usual;
    // A turned sensor: the mean of a second far from that of the others, by the spread of single samples.
    const bool turned = std::abs(blocks.mean[i] - centre) > kTimes * usual;
    if (!shaken && !turned) continue;
    if (n++ == 0) first = i;
  }
  constexpr double kFew = 0.002;  // single knocks on a table
  const auto share = static_cast<double>(n) / static_cast<double>(std::max<std::size_t>(1, blocks.sd.size()));
  if (n < 2 || share < kFew) return std::nullopt;
  return fmt::format(
      "the sensor was not at rest: {:.3g} % of the record is shaken or turned, first at {:.0f} s; cut the "
      "record down to its rest, or the numbers are those of the motion",
      100.0 * share, static_cast<double>(first) * blocks.seconds);
}

}  // namespace

std::optional<double> resolution_of(std::span<const double> x, std::span<const std::uint8_t> mask) {
  std::vector<double> values;
  for (std::size_t i = 0; i < x.size() && values.size() < kLookedAt; ++i) {
    if (mask[i] != 0) values.push_back(x[i]);
  }
  std::sort(values.begin(), values.end());
  const double spread = values.back() - values.front();
  if (!(spread > 0.0)) return std::nullopt;
  constexpr double kFinest = 1e-4;  // of the spread
  double step = spread;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double gap = values[i] - values[i - 1];
    if (gap > 0.01 * kFinest * spread) step = std::min(step, gap);
  }
  if (step < kFinest * spread) return std::nullopt;
  // Decimal files round: a tenth of a step is near enough to the grid.
  const auto on_grid = std::count_if(values.begin(), values.end(), [&](double v) {
    const double place = (v - values.front()) / step;
    return std::abs(place - std::round(place)) < 0.1;
  });
  constexpr double kNearlyAll = 0.99;
  if (static_cast<double>(on_grid) < kNearlyAll * static_cast<double>(values.size())) return std::nullopt;
  // A grid of at least three places.
  return spread / step >= 2.0 ? std::optional(step) : std::nullopt;
}

std::vector<std::string> record_warnings(const AxisRecord& record, std::span<const double> x,
                                         std::span<const std::uint8_t> mask, const AxisCertificate& so_far) {
  std::vector<std::string> warnings;
  if (const auto motion = motion_in(record.rate_hz, x, mask)) warnings.push_back(*motion);
  const Extremes e = extremes_of(x, mask);
  const auto n = static_cast<double>(so_far.n_samples);
  constexpr double kClipped = 1e-3;
  const double step = so_far.resolution.value_or(0.0);
  // Two values alone are a coarse grid. Of a grid many samples share a value, but noise has fewer the further
  // out it is: of a clipped signal the last value has more than the one beside it.
  const bool has_insides = static_cast<double>(e.at_low + e.at_high) < 0.9 * n;
  const auto clipped = [&](std::size_t at, double end, double inwards) {
    if (!has_insides || static_cast<double>(at) <= kClipped * n || at <= 10) return false;
    return static_cast<double>(at) >
           1.5 * static_cast<double>(count_near(x, mask, end + inwards, 0.5 * step));
  };
  const bool high = clipped(e.at_high, e.high, -step);
  if (high || clipped(e.at_low, e.low, step)) {
    warnings.push_back(
        fmt::format("{} samples are exactly {:.6g}: the end of the sensor's range; what lies beyond is lost",
                    high ? e.at_high : e.at_low, high ? e.high : e.low));
  }
  // Runs that noise of this spread and resolution would not make.
  const double in_a_row = step > 0.0 ? 40.0 * std::max(1.0, step / so_far.sd) : 5.0;
  if (static_cast<double>(e.longest_run) > std::max(in_a_row, record.rate_hz)) {
    warnings.push_back(fmt::format(
        "the value stands still for {:.3g} s at {:.0f} s: the sensor or the log was stuck",
        static_cast<double>(e.longest_run) / record.rate_hz, static_cast<double>(e.run_at) / record.rate_hz));
  }
  constexpr double kManyMissing = 0.05;
  const double missing = static_cast<double>(so_far.n_missing) / static_cast<double>(x.size());
  if (missing > kManyMissing)
    warnings.push_back(fmt::format("{:.2g} % of the samples are missing", 100.0 * missing));
  if (step > so_far.sd) {
    warnings.push_back(
        fmt::format("the resolution, {:.3g}, is coarser than the noise: what the table says of fast noise is "
                    "the quantization's",
                    step));
  }
  return warnings;
}

}  // namespace imuscope::certificate
