#include "models/noise/tails.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "models/noise/chi_squared.h"
#include "models/noise/process.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Above this share of a level, the fourth cumulant of quantization shows in the robust wavelet variance.
constexpr double kMostQuantization = 0.1;
/// Directions in which the differences vary by less than this share of the most carry nothing but rounding.
constexpr double kLeastVariance = 1e-8;

double quantization_share(const Model& model, int level) {
  double part = 0.0;
  for (const Component& c : model.components) {
    if (c.kind == ProcessKind::kQuantization) part += model_wv({{c}}, level);
  }
  return part / model_wv(model, level);
}

constexpr std::size_t kMostSamples = std::size_t{1} << 18U;
constexpr std::size_t kBlock = std::size_t{1} << 13U;
/// Between two blocks: more than half a support of the last level bears.
constexpr std::size_t kApart = std::size_t{1} << (kTailLevels - 3U);

}  // namespace

TailExcerpt tail_excerpt(std::span<const double> x, std::span<const std::uint8_t> mask) {
  const std::size_t stride = kBlock * ((x.size() + kMostSamples - 1) / kMostSamples);
  TailExcerpt out;
  for (std::size_t begin = 0; begin < x.size(); begin += stride) {
    const std::size_t length = std::min(kBlock, x.size() - begin);
    out.values.insert(out.values.end(), x.begin() + static_cast<std::ptrdiff_t>(begin),
                      x.begin() + static_cast<std::ptrdiff_t>(begin + length));
    for (std::size_t i = begin; i < begin + length; ++i)
      out.mask.push_back(mask.empty() || mask[i] != 0 ? 1 : 0);
    if (stride == kBlock) continue;
    out.values.resize(out.values.size() + kApart, 0.0);
    out.mask.resize(out.mask.size() + kApart, 0);
  }
  return out;
}

std::optional<TailTest> test_tails(std::span<const double> x, const WvOptions& options, const Model& model) {
  return test_tails(tail_excerpt(x, options.mask), options, model);
}

std::optional<TailTest> test_tails(const TailExcerpt& excerpt, const WvOptions& options, const Model& model) {
  WvOptions looked_at = options;
  looked_at.levels = 0;
  looked_at.robust.reset();
  looked_at.mask = excerpt.mask;
  const auto all_levels = haar_wavelet_variance(excerpt.values, looked_at);
  if (!all_levels) return std::nullopt;
  const WaveletVariance& classical = *all_levels;
  looked_at.levels = std::min(kTailLevels, static_cast<int>(classical.levels.size()));
  looked_at.robust = RobustOptions{};
  const auto robust = haar_wavelet_variance(excerpt.values, looked_at);
  if (!robust) return std::nullopt;
  const Eigen::MatrixXd all = robust_loss(model, *robust, robust->levels.size());
  std::vector<Eigen::Index> used;
  for (std::size_t i = 0; i < robust->levels.size(); ++i) {
    const WvLevel& level = robust->levels[i];
    if (has_enough_coefficients(level, robust->efficiency) && level.value > 0.0 &&
        quantization_share(model, level.level) < kMostQuantization)
      used.push_back(static_cast<Eigen::Index>(i));
  }
  if (used.empty()) return std::nullopt;
  Eigen::VectorXd difference(static_cast<Eigen::Index>(used.size()));
  TailTest test;
  double clearest = -1.0;
  for (std::size_t k = 0; k < used.size(); ++k) {
    const auto i = static_cast<std::size_t>(used[k]);
    const double d = classical.levels[i].value - robust->levels[i].value;
    difference(static_cast<Eigen::Index>(k)) = d;
    const double in_sd = std::abs(d) / std::sqrt(all(used[k], used[k]));
    if (in_sd <= clearest) continue;
    clearest = in_sd;
    test.level = classical.levels[i].level;
    test.excess = d / robust->levels[i].value;
  }
  // G-35
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of_loss(all(used, used));
  const Eigen::VectorXd along = of_loss.eigenvectors().transpose() * difference;
  for (Eigen::Index k = 0; k < along.size(); ++k) {
    const double variance = of_loss.eigenvalues()(k);
    if (!(variance > kLeastVariance * of_loss.eigenvalues().maxCoeff())) continue;
    test.statistic += along(k) * along(k) / variance;
    ++test.dof;
  }
  if (test.dof == 0) return std::nullopt;
  test.p_value = chi_squared_p_value(test.statistic, test.dof);
  return test;
}

std::optional<std::string> spike_warning(const std::optional<TailTest>& test, double rate_hz) {
  // Fewer large values than a Gaussian signal has are no spikes.
  if (!test || test->p_value >= kSpikesBelow || test->excess <= 0.0) return std::nullopt;
  constexpr double kFactorsFrom = 5.0;
  const std::string by_how_much = test->excess < kFactorsFrom
                                      ? fmt::format("lies {:.3g} % above", 100.0 * test->excess)
                                      : fmt::format("is {:.3g} times", 1.0 + test->excess);
  return fmt::format(
      "spikes, or noise that changes: at {:.3g} s the wavelet variance {} a robust one (chance {:.2g}), so "
      "that the model and its intervals hold them; `fit --robust` gives the noise without them",
      std::ldexp(1.0, test->level) / rate_hz, by_how_much, test->p_value);
}

}  // namespace imuscope::noise
