#include "models/noise/wv_covariance.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "models/noise/covariance_corrections.h"
#include "models/noise/cross_covariance.h"
#include "models/noise/lag_sum.h"
#include "models/noise/pair_counts.h"
#include "models/noise/robust_scale.h"

namespace imuscope::noise {
namespace {

/// Variance of the coefficients of two levels and the terms of biweight_correlation_terms(), empty for the
/// classical estimator.
struct RobustTerms {
  double variance_j = 1.0;
  double variance_k = 1.0;
  std::vector<double> terms;
};

/// G-8: sums N_jk(h) [2 C^2 + 4 m_j m_k C] at distances x >= 0 from the centre lag n_k - n_j, both sides together:
/// C is symmetric about that lag. In the form that LagSum takes.
class PairTerm {
 public:
  PairTerm(CrossCovariance c, const PairCounts& pairs, double centre, double means, const RobustTerms& robust)
      : c_(std::move(c)), pairs_(pairs), centre_(centre), means_(means), robust_(robust) {}

  void enter(double p, double q) { c_.enter(centre_ + p, centre_ + q); }
  void add_inside(double x, double weight) { sum_ += weight * weighted(x, c_.inside(centre_ + x)); }
  void add_at(double x) { sum_ += weighted(x, c_(centre_ + x)); }
  [[nodiscard]] double sum() const { return sum_; }

 private:
  [[nodiscard]] double weighted(double x, double c) const {
    return pairs_.at_distance(centre_, x) * (covariance_of_squares(c) + means_ * c);
  }
  [[nodiscard]] double covariance_of_squares(double c) const {
    if (robust_.terms.empty()) return 2.0 * c * c;  // G-8; else G-11
    const double scale = robust_.variance_j * robust_.variance_k;
    const double rho2 = c * c / scale;
    double sum = 0.0;
    for (auto term = robust_.terms.rbegin(); term != robust_.terms.rend(); ++term) sum = (sum + *term) * rho2;
    return sum * scale;
  }

  CrossCovariance c_;
  const PairCounts& pairs_;
  double centre_;
  double means_;
  const RobustTerms& robust_;
  double sum_ = 0.0;
};

/// G-34
Parts with_missing(const Parts& parts, const WvLevel& j, const WvLevel& k) {
  Parts out = parts;
  out.white += white_of_missing(j, k);
  return out;
}

/// G-39: what acts like a simpler process on both levels becomes that, where the model is approximate or the
/// difference small: of the processes that stand for a power law, those that are a random walk to both
/// levels, or white noise to both, become just that: to within what the sum itself deviates by.
Parts folded(Parts parts, double n_j, double n_k) {
  constexpr double kWalk = 0.02;  // of a n: 2 sigma2 (1 - e^{-a n}) is a walk's growth to a hundredth
  constexpr double kWhite = 50.0;
  std::erase_if(parts.exponentials, [&](const Exponential& e) {
    if (!e.is_approximate) return false;
    const bool is_walk = e.a * std::max(n_j, n_k) < kWalk;
    const bool is_white = e.a * std::min(n_j, n_k) > kWhite;
    if (is_walk) parts.walk += 2.0 * e.a * e.variance;
    if (is_white) parts.white += 2.0 * e.linear * e.variance;
    return is_walk || is_white;
  });
  std::erase_if(parts.oscillations, [&](const Oscillation& o) {
    if (std::min(n_j, n_k) < white_from(o)) return false;
    parts.white += 2.0 * o.linear;
    return true;
  });
  return parts;
}

double covariance_of_pair(const Parts& whole, const WvLevel& j, const WvLevel& k, const LevelPlaces& at_j,
                          const LevelPlaces& at_k, const std::vector<Segment>& runs,
                          const std::vector<double>& robust_terms) {
  const double n_j = 0.5 * j.tau_samples;
  const double n_k = 0.5 * k.tau_samples;
  const Parts parts = folded(with_missing(whole, j, k), n_j, n_k);
  const PairCounts pairs(j, k, at_j, at_k);
  // G-8: the means that a ramp causes
  const double means = 4.0 * (0.5 * parts.ramp * n_j) * (0.5 * parts.ramp * n_k);
  const double centre = n_k - n_j;
  RobustTerms robust;
  if (!robust_terms.empty()) {
    robust = {CrossCovariance(with_missing(whole, j, j), n_j, n_j)(0.0),
              CrossCovariance(with_missing(whole, k, k), n_k, n_k)(0.0), robust_terms};
  }
  PairTerm term(CrossCovariance(parts, n_j, n_k), pairs, centre, means, robust);
  std::vector<double> breaks = breaks_of(n_j, n_k);
  // Beyond the overlap of the supports only exponentials reach, and none further than this many time
  // constants.
  constexpr double kTimeConstants = 18.0;
  constexpr double kExactNearAlternating = 64.0;
  double reach = 0.0;
  double exact_near = kExactNear;
  for (const Oscillation& o : parts.oscillations) {
    // While it rings no block of lags is smooth.
    reach = std::max(reach, kTimeConstants / o.rate.real());
    exact_near = std::max(exact_near, rings_for(o));
  }
  for (const Exponential& e : parts.exponentials) {
    const double a = e.a > 0.0 ? e.a : -std::log(std::abs(e.phi));
    reach = std::max(reach, kTimeConstants / a);
    if (e.a < 0.0) exact_near = std::max(exact_near, kExactNearAlternating);
  }
  const double furthest_pair = std::max(pairs.highest() - centre, centre - pairs.lowest());
  const double high = std::min(furthest_pair, breaks.back() + std::ceil(reach));
  LagSum(term, exact_near).between(breaks_of_lags(std::move(breaks), pairs, centre, high), 0.0, high);
  const double count_j = static_cast<double>(j.n_coefficients);
  const double count_k = static_cast<double>(k.n_coefficients);
  double result = term.sum() / (count_j * count_k);
  // G-10, G-44
  if (parts.uniform > 0.0) result += uniform_correction(parts.uniform, runs, j, k);
  return result + sinusoid_covariance(parts, j, k);
}

/// @param robust_terms  of G-11; empty: classical
Eigen::MatrixXd covariance(const Model& model, const WaveletVariance& wv, std::size_t levels,
                           const std::vector<double>& robust_terms) {
  const Parts parts = parts_of(model);
  const auto size = static_cast<Eigen::Index>(levels);
  Eigen::MatrixXd v(size, size);
  std::vector<LevelPlaces> places;
  for (std::size_t j = 0; j < levels; ++j) places.push_back(places_of(wv, wv.levels[j]));
  for (std::size_t j = 0; j < levels; ++j) {
    for (std::size_t k = 0; k <= j; ++k) {
      const double value = covariance_of_pair(parts, wv.levels[j], wv.levels[k], places[j], places[k],
                                              wv.segments, robust_terms);
      v(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(k)) = value;
      v(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) = value;
    }
  }
  const bool is_exact =
      std::all_of(places.begin(), places.end(), [](const auto& p) { return p.places.empty(); });
  return is_exact ? v : bounded_below(v);
}

}  // namespace

double coefficient_covariance(const Model& model, int level_j, int level_k, double lag) {
  const Parts parts = parts_of(model);
  return CrossCovariance(parts, std::ldexp(1.0, level_j - 1), std::ldexp(1.0, level_k - 1))(lag);
}

Eigen::MatrixXd wv_covariance(const Model& model, const WaveletVariance& wv, std::size_t levels) {
  return covariance(model, wv, levels,
                    wv.efficiency < 1.0 ? biweight_correlation_terms(wv.efficiency) : std::vector<double>{});
}

Eigen::MatrixXd robust_loss(const Model& model, const WaveletVariance& robust, std::size_t levels) {
  auto terms = biweight_correlation_terms(robust.efficiency);
  terms.front() = 0.0;  // that of the classical one
  return covariance(model, robust, levels, terms);
}

}  // namespace imuscope::noise
