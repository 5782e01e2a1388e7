#include "models/noise/pair_counts.h"

#include <algorithm>

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

}  // namespace imuscope::noise
