#include "models/noise/pair_counts.h"

#include <algorithm>
#include <utility>

namespace imuscope::noise {

LevelPlaces places_of(const WaveletVariance& wv, const WvLevel& level) {
  LevelPlaces out;
  out.width = level.tau_samples;
  const auto n = static_cast<std::size_t>(0.5 * level.tau_samples);
  out.bears_holes = least_valid(n) < n;
  const auto add = [&](std::size_t begin, std::size_t end) {
    out.places.push_back({static_cast<double>(begin), static_cast<double>(end)});
  };
  for (const Segment& s : level.places) add(s.begin, s.end);
  if (out.places.empty() && wv.segments.size() > 1) {
    for (const Segment& s : wv.segments) {
      if (s.end - s.begin >= 2 * n) add(s.begin + 2 * n - 1, s.end);
    }
  }
  double positions = 0.0;
  for (const Stretch& s : out.places) positions += s.end - s.begin;
  if (positions > 0.0) out.kept = std::min(1.0, static_cast<double>(level.n_coefficients) / positions);
  return out;
}

std::vector<double> breaks_of_lags(std::vector<double> of_covariance, const PairCounts& pairs, double centre,
                                   double furthest) {
  std::vector<double> breaks = std::move(of_covariance);
  for (const double lag : pairs.kinks(centre, furthest)) breaks.push_back(std::abs(lag - centre));
  std::sort(breaks.begin(), breaks.end());
  breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
  return breaks;
}

}  // namespace imuscope::noise
