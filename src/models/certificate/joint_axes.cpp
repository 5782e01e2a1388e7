#include "models/certificate/joint_axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "models/certificate/all_cores.h"
#include "models/noise/covariance_table.h"
#include "models/noise/holm.h"

namespace imuscope::certificate {
namespace {

using noise::CrossLevel;

/// Takes the shape of most sensors' noise, by which the coefficients of a scale hang together in time.
constexpr const char* kShape = "WN+2*GM+RW";
/// A record with fewer scales than that model has parameters takes this.
constexpr const char* kSimpleShape = "WN";

Result<noise::FitResult> shape_of(std::span<const double> x, std::span<const std::uint8_t> mask,
                                  double rate_hz, noise::CovarianceTables& covariances) {
  noise::WvOptions options;
  options.mask = mask;
  const auto wv = noise::haar_wavelet_variance(x, options);
  if (!wv) return tl::unexpected(wv.error());
  noise::FitOptions fit_options;
  fit_options.covariances = &covariances;
  auto fit = noise::fit(*wv, *noise::parse_model(kShape), rate_hz, fit_options);
  if (!fit) fit = noise::fit(*wv, *noise::parse_model(kSimpleShape), rate_hz, fit_options);
  return fit;
}

std::vector<std::uint8_t> where_all_are(std::span<const JointSignal> signals) {
  std::vector<std::uint8_t> mask(signals.front().values.size(), 1);
  for (const JointSignal& signal : signals) {
    for (std::size_t t = 0; t < mask.size() && t < signal.values.size(); ++t) {
      if (!std::isfinite(signal.values[t])) mask[t] = 0;
    }
  }
  return mask;
}

Result<std::vector<CrossLevel>> levels_of(std::span<const JointSignal> signals,
                                          std::span<const std::uint8_t> mask, double rate_hz,
                                          noise::CovarianceTables* shared) {
  noise::CovarianceTables own;
  noise::CovarianceTables& covariances = shared != nullptr ? *shared : own;
  std::vector<Result<noise::FitResult>> shapes(signals.size(), work_error("not looked at"));
  on_all_cores(signals.size(),
               [&](std::size_t i) { shapes[i] = shape_of(signals[i].values, mask, rate_hz, covariances); });
  std::vector<std::span<const double>> values;
  std::vector<noise::FitResult> fits;
  for (std::size_t i = 0; i < signals.size(); ++i) {
    if (!shapes[i]) {
      Error error = shapes[i].error();
      error.what = fmt::format("{}: {}", signals[i].name, error.what);
      return tl::unexpected(error);
    }
    values.push_back(signals[i].values);
    fits.push_back(std::move(*shapes[i]));
  }
  return noise::cross_variance(values, mask, fits, &covariances, on_all_cores);
}

std::vector<CrossLevel> chosen(std::span<const CrossLevel> levels, const JointOptions& options) {
  std::vector<CrossLevel> out;
  for (const CrossLevel& level : levels) {
    const double tau_s = level.tau_samples / options.rate_hz;
    if (level.dof >= kSquaresOfWeights && tau_s >= options.from_s && tau_s <= options.to_s)
      out.push_back(level);
  }
  return out;
}

/// Sum over the scales of the mean's wavelet variance, each scale counted alike as in G-64.
double cost_of(std::span<const CrossLevel> scales, const Eigen::VectorXd& weights) {
  double sum = 0.0;
  for (const CrossLevel& scale : scales)
    sum += weighted_variance(scale, weights) / scale.covariance.diagonal().mean();
  return sum;
}

/// All weight on the signal that is quietest by itself.
Eigen::VectorXd best_single(std::span<const CrossLevel> scales) {
  const auto n = scales.front().covariance.rows();
  Eigen::VectorXd best;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd single = Eigen::VectorXd::Unit(n, i);
    if (best.size() == 0 || cost_of(scales, single) < cost_of(scales, best)) best = single;
  }
  return best;
}

/// Weights and best signal of one half, measured on the other; both ways.
double held_out_ratio(std::span<const JointSignal> signals, std::span<const std::uint8_t> mask,
                      const JointOptions& options, std::size_t scales) {
  std::vector<std::vector<CrossLevel>> halves;
  for (const bool second : {false, true}) {
    std::vector<std::uint8_t> half(mask.begin(), mask.end());
    const auto middle = static_cast<std::ptrdiff_t>(half.size() / 2);
    std::fill(second ? half.begin() : half.begin() + middle, second ? half.begin() + middle : half.end(),
              std::uint8_t{0});
    auto levels = levels_of(signals, half, options.rate_hz, nullptr);
    if (!levels) return std::numeric_limits<double>::quiet_NaN();
    std::vector<CrossLevel> kept;
    for (const CrossLevel& level : *levels) {
      const double tau_s = level.tau_samples / options.rate_hz;
      if (tau_s >= options.from_s && tau_s <= options.to_s && kept.size() < scales) kept.push_back(level);
    }
    halves.push_back(std::move(kept));
  }
  double mean = 0.0;
  double single = 0.0;
  for (const std::size_t from : {std::size_t{0}, std::size_t{1}}) {
    const auto& other = halves[1 - from];
    mean += cost_of(other, quietest_weights(halves[from]));
    single += cost_of(other, best_single(halves[from]));
  }
  return std::sqrt(mean / single);
}

std::vector<JointPair> pairs_of(std::span<const CrossLevel> levels, const JointOptions& options) {
  const Eigen::Index n = levels.front().covariance.rows();
  std::vector<JointPair> pairs;
  std::vector<std::optional<double>> p_values;
  constexpr double kFewestSquares = 5.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = i + 1; k < n; ++k) {
      JointPair pair;
      pair.first = static_cast<std::size_t>(i);
      pair.second = static_cast<std::size_t>(k);
      double scales = 0.0;
      for (const CrossLevel& level : levels) {
        if (level.dof < kFewestSquares) continue;
        ++scales;
        const auto coherence = coherence_of(level, i, k, options.confidence);
        if (scales > 1.0 && coherence.p_value >= pair.coherence.p_value) continue;
        pair.coherence = coherence;
        pair.tau_s = level.tau_samples / options.rate_hz;
      }
      // The plainest of so many scales.
      p_values.emplace_back(std::min(1.0, scales * pair.coherence.p_value));
      pairs.push_back(pair);
    }
  }
  const auto adjusted = noise::holm_adjusted(p_values);
  for (std::size_t i = 0; i < pairs.size(); ++i) pairs[i].p_holm = adjusted[i].value_or(1.0);
  return pairs;
}

}  // namespace

bool JointPair::shows() const {
  constexpr double kSmall = 0.1;
  return p_holm < noise::kSignificance && (coherence.ci_low > kSmall || coherence.ci_high < -kSmall);
}

Result<JointAxes> joint_axes(std::span<const JointSignal> signals, const JointOptions& options) {
  if (signals.size() < 2)
    return work_error("there is one signal alone",
                      "give a run with several S-IMUs, or a log with several axes");
  const auto mask = where_all_are(signals);
  const auto levels = levels_of(signals, mask, options.rate_hz, options.covariances);
  if (!levels) return tl::unexpected(levels.error());
  JointAxes out;
  out.rate_hz = options.rate_hz;
  out.samples = static_cast<std::uint64_t>(std::count(mask.begin(), mask.end(), std::uint8_t{1}));
  out.pairs = pairs_of(*levels, options);
  const auto n = static_cast<Eigen::Index>(signals.size());
  const auto scales = chosen(*levels, options);
  Eigen::VectorXd weights;
  if (options.share_a_reference) {
    if (scales.empty()) {
      return usage_error(
          fmt::format("no scale between {:g} and {:g} s is worth {:.0f} independent squares", options.from_s,
                      options.to_s, kSquaresOfWeights),
          fmt::format("choose shorter scales with --from and --to, or record longer: {:g} s are there",
                      static_cast<double>(out.samples) / options.rate_hz));
    }
    weights = quietest_weights(scales);
    out.weights.assign(weights.begin(), weights.end());
    out.from_s = scales.front().tau_samples / options.rate_hz;
    out.to_s = scales.back().tau_samples / options.rate_hz;
    out.ratio = std::sqrt(cost_of(scales, weights) / cost_of(scales, best_single(scales)));
    out.held_out = held_out_ratio(signals, mask, options, scales.size());
  }
  for (const CrossLevel& level : *levels) {
    JointScale scale;
    scale.tau_s = level.tau_samples / options.rate_hz;
    scale.squares = level.dof;
    for (Eigen::Index i = 0; i < n; ++i) scale.variance.push_back(level.covariance(i, i));
    if (options.share_a_reference) {
      scale.common = common_of(level, options.confidence);
      for (Eigen::Index i = 0; i < n; ++i) scale.own.push_back(own_of(level, i, options.confidence));
      scale.mean_variance = weighted_variance(level, weights);
    }
    out.scales.push_back(std::move(scale));
  }
  return out;
}

}  // namespace imuscope::certificate
