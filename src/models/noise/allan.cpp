#include "models/noise/allan.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "models/noise/chi_squared.h"
#include "models/noise/fixed_point.h"
#include "models/noise/haar_levels.h"

namespace imuscope::noise {
namespace {

/// Places of neighbouring differences are apart by up to this share of a mean: nearer ones tell nothing new.
constexpr std::size_t kPlacesPerMean = 32;

/// Sums of the samples before every `step`-th place, and how many of them are there, in the samples' place.
class RunningSums {
 public:
  RunningSums(std::vector<double> x, const std::vector<Segment>& runs) : sums_(std::move(x)) {
    const std::size_t length = sums_.size();
    is_whole_ = runs.size() == 1 && runs.front().begin == 0 && runs.front().end == length;
    if (!is_whole_) counts_.reserve(length + 1);
    sums_.push_back(0.0);
    const double offset = runs.empty() ? 0.0 : sums_[runs.front().begin];
    double sum = 0.0;
    std::uint32_t count = 0;
    auto run = runs.begin();
    for (std::size_t i = 0; i < length; ++i) {
      while (run != runs.end() && run->end <= i) ++run;
      const bool is_there = run != runs.end() && run->begin <= i;
      const double sample = std::exchange(sums_[i], sum);
      if (!is_whole_) counts_.push_back(count);
      if (!is_there) continue;
      sum += sample - offset;
      ++count;
    }
    sums_[length] = sum;
    if (!is_whole_) counts_.push_back(count);
  }

  [[nodiscard]] std::size_t step() const { return step_; }

  /// Keeps every second place.
  void thin_out() {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < sums_.size(); i += 2, ++kept) {
      sums_[kept] = sums_[i];
      if (!is_whole_) counts_[kept] = counts_[i];
    }
    sums_.resize(kept);
    if (!is_whole_) counts_.resize(kept);
    step_ *= 2;
  }

  /// G-40: mean square of the differences of neighbouring means of n samples, n a multiple of step().
  [[nodiscard]] double mean_square(std::size_t n, std::uint64_t& count) const {
    return is_whole_ ? mean_square_of_whole(n, count) : mean_square_of_valid(n, count);
  }

 private:
  [[nodiscard]] double mean_square_of_whole(std::size_t n, std::uint64_t& count) const {
    const std::size_t k = n / step_;
    const auto places = static_cast<std::ptrdiff_t>(sums_.size()) - static_cast<std::ptrdiff_t>(2 * k);
    count = static_cast<std::uint64_t>(std::max<std::ptrdiff_t>(places, 0));
    if (count == 0) return 0.0;
    const auto at = [&](std::size_t from) {
      return Eigen::Map<const Eigen::ArrayXd>(sums_.data() + from, places);
    };
    const double squares = ((at(2 * k) - at(k)) - (at(k) - at(0))).square().sum();
    return squares / (static_cast<double>(n) * static_cast<double>(n)) / static_cast<double>(count);
  }

  [[nodiscard]] double mean_square_of_valid(std::size_t n, std::uint64_t& count) const {
    const std::size_t k = n / step_;
    const auto least = static_cast<std::uint32_t>(least_valid(n));
    double sum = 0.0;
    count = 0;
    for (std::size_t i = 0; i + 2 * k < sums_.size(); ++i) {
      const std::uint32_t older = counts_[i + k] - counts_[i];
      const std::uint32_t newer = counts_[i + 2 * k] - counts_[i + k];
      if (older < least || newer < least) continue;
      const double difference = (sums_[i + 2 * k] - sums_[i + k]) / newer - (sums_[i + k] - sums_[i]) / older;
      sum += difference * difference;
      ++count;
    }
    return count > 0 ? sum / static_cast<double>(count) : 0.0;
  }

  std::vector<double> sums_;
  std::vector<std::uint32_t> counts_;  ///< of a whole record empty
  bool is_whole_ = false;
  std::size_t step_ = 1;
};

AllanPoint of_level(const WvLevel& level, double rate_hz) {
  AllanPoint point;
  point.n = static_cast<std::uint64_t>(0.5 * level.tau_samples);
  point.tau_s = static_cast<double>(point.n) / rate_hz;
  point.deviation = std::sqrt(2.0 * level.value);  // G-40
  point.n_differences = level.n_coefficients;
  return point;
}

std::size_t shown_levels(const WaveletVariance& wv) {
  std::size_t shown = 0;
  while (shown < wv.levels.size() && has_enough_coefficients(wv.levels[shown], wv.efficiency)) ++shown;
  return shown > 0 ? shown : wv.levels.size();
}

/// Linear in the logarithm of the averaging time between two levels.
double between(double low, double high, double share) { return low + share * (high - low); }

}  // namespace

std::vector<AllanPoint> allan_deviation(std::vector<double> x, const WaveletVariance& wv, double rate_hz,
                                        int points_per_octave, const Remainders& remainders) {
  std::vector<AllanPoint> points;
  const std::size_t shown = shown_levels(wv);
  RunningSums sums(std::move(x), wv.segments);
  std::uint64_t previous = 0;
  for (std::size_t i = 0; i < shown; ++i) {
    points.push_back(of_level(wv.levels[i], rate_hz));
    if (i + 1 == shown) break;
    const std::size_t octave = std::size_t{1} << i;
    while (sums.step() * kPlacesPerMean < octave) sums.thin_out();
    previous = octave;
    for (int k = 1; k < points_per_octave; ++k) {
      const double share = static_cast<double>(k) / points_per_octave;
      const auto places = static_cast<std::size_t>(
          std::lround(static_cast<double>(octave) * std::exp2(share) / static_cast<double>(sums.step())));
      const std::size_t n = places * sums.step();
      if (n <= previous || n >= 2 * octave) continue;
      previous = n;
      AllanPoint point;
      point.n = n;
      point.tau_s = static_cast<double>(n) / rate_hz;
      const double square = sums.mean_square(n, point.n_differences);
      const double exact_share = std::log2(static_cast<double>(n) / static_cast<double>(octave));
      const double inflation = std::exp(
          between(std::log(wv.levels[i].inflation), std::log(wv.levels[i + 1].inflation), exact_share));
      const double wv_here = 0.25 * square / inflation;
      point.deviation = std::sqrt(2.0 * remainders.taken_out_of(wv_here, static_cast<double>(n)));  // G-40
      if (point.n_differences > 0) points.push_back(point);
    }
  }
  set_allan_intervals(points, nullptr, 0.95);
  return points;
}

// G-40: degrees of freedom
void set_allan_intervals(std::vector<AllanPoint>& points, const FitResult* fit, double confidence,
                         const CovarianceTable* table) {
  std::vector<double> log_dof;  // of the levels
  if (fit != nullptr) {
    const Eigen::MatrixXd v = sampling_covariance(fit->model, observed_wv(*fit), fit->wv.size(), table);
    for (std::size_t i = 0; i < fit->wv.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      log_dof.push_back(std::log(2.0 * fit->wv[i].fitted * fit->wv[i].fitted / v(k, k)));
    }
  }
  for (AllanPoint& point : points) {
    const auto n = static_cast<double>(point.n);
    point.degrees_of_freedom = static_cast<double>(point.n_differences) / (2.0 * n);
    if (!log_dof.empty()) {
      const double place = std::clamp(std::log2(n), 0.0, static_cast<double>(log_dof.size() - 1));
      const auto below = std::min(static_cast<std::size_t>(place), log_dof.size() - 1);
      const auto above = std::min(below + 1, log_dof.size() - 1);
      point.degrees_of_freedom =
          std::exp(between(log_dof[below], log_dof[above], place - static_cast<double>(below)));
    }
    const double dof = std::max(point.degrees_of_freedom, 1.0);
    point.degrees_of_freedom = dof;
    const double tail = 0.5 * (1.0 - confidence);
    point.ci_low = point.deviation * std::sqrt(dof / chi_squared_quantile(dof, 1.0 - tail));
    point.ci_high = point.deviation * std::sqrt(dof / chi_squared_quantile(dof, tail));
  }
}

double model_allan_deviation(const Model& model, double n) {
  // The curves of process.h are of whole levels; between them the logarithm of the variance is a parabola
  // through the three nearest, which follows a slope that bends slowly.
  const double place = std::clamp(std::log2(n), 0.0, static_cast<double>(kMaxLevel - 1));
  const int middle = std::clamp(static_cast<int>(std::lround(place)), 1, kMaxLevel - 2);
  const double d = place - middle;
  const auto log_at = [&](int octave) { return std::log(2.0 * model_wv(model, octave + 1)); };
  const double low = log_at(middle - 1);
  const double here = log_at(middle);
  const double high = log_at(middle + 1);
  return std::exp(0.5 * (here + 0.5 * d * (high - low) + 0.5 * d * d * (high - 2.0 * here + low)));
}

}  // namespace imuscope::noise
