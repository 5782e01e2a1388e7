#include "models/noise/pair_counts.h"

#include <algorithm>

namespace imuscope::noise {

LevelPlaces places_of(const WaveletVariance& wv, const WvLevel& level) {
  LevelPlaces out;
  out.width = level.tau_samples;
  const auto n = static_cast<std::size_t>(0.5 * level.tau_samples);
  out.bears_holes = least_valid(n) < n;
  out.places = level.places;
  if (out.places.empty() && wv.segments.size() > 1) {
    for (const Segment& s : wv.segments) {
      if (s.end - s.begin >= 2 * n) out.places.push_back({s.begin + 2 * n - 1, s.end});
    }
  }
  double positions = 0.0;
  for (const Segment& s : out.places) positions += static_cast<double>(s.end - s.begin);
  if (positions > 0.0) out.kept = std::min(1.0, static_cast<double>(level.n_coefficients) / positions);
  return out;
}

}  // namespace imuscope::noise
