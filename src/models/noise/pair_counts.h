#pragma once

/// Of wv_covariance() and CovarianceTable alone: how many pairs of coefficients of two levels there are.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// A run of places, [begin, end), as numbers to add lags to: they are asked for so often that turning them
/// into doubles each time would cost as much as the rest.
struct Stretch {
  double begin = 0.0;
  double end = 0.0;
};

/// Where a level has coefficients: stretches of their newest samples, and the share of these that it keeps.
struct LevelPlaces {
  std::vector<Stretch> places;  ///< empty: one stretch, that ends at the newest sample
  double kept = 1.0;
  double width = 0.0;        ///< 2^j
  bool bears_holes = false;  ///< single missing samples; where not, what it loses depends on the overlap
};

LevelPlaces places_of(const WaveletVariance& wv, const WvLevel& level);

/// N_jk(h) of G-8: pairs of coefficients at a lag. In runs joined over missing samples a share of the
/// positions is kept (G-34).
class PairCounts {
 public:
  PairCounts(const WvLevel& j, const WvLevel& k, const LevelPlaces& at_j, const LevelPlaces& at_k)
      : j_(at_j),
        k_(at_k),
        m_j_(static_cast<double>(j.n_coefficients)),
        m_k_(static_cast<double>(k.n_coefficients)) {}

  [[nodiscard]] double operator()(double h) const {
    if (j_.places.empty() || k_.places.empty()) {
      // Both runs end at the newest sample.
      return std::max(0.0, std::min(0.0, -h) - std::max(-m_j_, -m_k_ - h));
    }
    return kept_together(h) * positions(h);
  }

  /// Those at both lags of a distance x >= 0 from `centre`.
  [[nodiscard]] double at_distance(double centre, double x) const {
    return (*this)(centre + x) + (x > 0.0 ? (*this)(centre - x) : 0.0);
  }

  /// Lags within `reach` of `centre` at which the number of pairs changes its slope. None where they are
  /// many: then each of them matters little.
  [[nodiscard]] std::vector<double> kinks(double centre, double reach) const {
    constexpr std::size_t kMostKinks = 64;
    std::vector<double> out;
    auto first = k_.places.begin();
    for (const Stretch& run : j_.places) {
      const double low = run.begin + centre - reach;
      const double high = run.end + centre + reach;
      while (first != k_.places.end() && first->end < low) ++first;
      for (auto other = first; other != k_.places.end() && other->begin <= high; ++other) {
        for (const double to : {other->begin, other->end}) {
          for (const double from : {run.begin, run.end}) {
            const double lag = to - from;
            if (std::abs(lag - centre) <= reach) out.push_back(lag);
          }
        }
        if (out.size() > kMostKinks) return {};
      }
    }
    return out;
  }

  /// Lags beyond these have no pairs.
  [[nodiscard]] double lowest() const { return -extent(); }
  [[nodiscard]] double highest() const { return extent(); }

 private:
  [[nodiscard]] double positions(double h) const {
    double sum = 0.0;
    std::size_t first = 0;
    for (const Stretch& s : j_.places) {
      const double begin = s.begin + h;
      const double end = s.end + h;
      while (first < k_.places.size() && k_.places[first].end <= begin) ++first;
      for (std::size_t i = first; i < k_.places.size(); ++i) {
        const Stretch& other = k_.places[i];
        if (other.begin >= end) break;
        sum += std::max(0.0, std::min(end, other.end) - std::max(begin, other.begin));
      }
    }
    return sum;
  }

  /// Chance that both coefficients of a pair are kept. What overlaps is kept or lost together, where no
  /// missing sample is borne; of one level always.
  [[nodiscard]] double kept_together(double h) const {
    const double both = j_.kept * k_.kept;
    if (both == 1.0) return 1.0;
    if (j_.width != k_.width && (j_.bears_holes || k_.bears_holes)) return both;
    // The supports end at 0 and at h.
    const double overlap = std::max(0.0, std::min(0.0, h) - std::max(-j_.width, h - k_.width));
    const double most = std::max(j_.kept, k_.kept);
    return both * std::pow(most, -overlap / std::min(j_.width, k_.width));
  }

  [[nodiscard]] double extent() const {
    if (j_.places.empty() || k_.places.empty()) return std::max(m_j_, m_k_);
    return std::max(j_.places.back().end, k_.places.back().end) -
           std::min(j_.places.front().begin, k_.places.front().begin);
  }

  const LevelPlaces& j_;
  const LevelPlaces& k_;
  double m_j_;
  double m_k_;
};

/// Distances from `centre` between which a sum over lags has no corner: those of C_jk, and of the pairs' number.
/// @param of_covariance  breaks_of()
/// @param furthest       lags that are summed
std::vector<double> breaks_of_lags(std::vector<double> of_covariance, const PairCounts& pairs, double centre,
                                   double furthest);

}  // namespace imuscope::noise
