#include "estimation/regimes/regime_track.h"

#include <algorithm>

#include "base/contracts.h"

namespace imuscope {

RegimeTrack::RegimeTrack(std::vector<std::string> names, const std::vector<RegimeStretch>& stretches)
    : names_(std::move(names)) {
  for (const auto& stretch : stretches) {
    IMUSCOPE_EXPECTS(stretch.regime < names_.size());
    if (stretch.end <= stretch.begin) continue;
    if (!stretches_.empty()) {
      auto& last = stretches_.back();
      IMUSCOPE_EXPECTS(stretch.begin >= last.end);
      if (last.regime == stretch.regime && last.end == stretch.begin) {
        last.end = stretch.end;
        continue;
      }
    }
    stretches_.push_back(stretch);
  }
}

std::optional<std::size_t> RegimeTrack::at(HostTime time) const noexcept {
  const auto after = std::upper_bound(stretches_.begin(), stretches_.end(), time,
                                      [](HostTime t, const RegimeStretch& s) { return t < s.begin; });
  if (after == stretches_.begin()) return std::nullopt;
  const auto& stretch = *(after - 1);
  return time < stretch.end ? std::optional(stretch.regime) : std::nullopt;
}

std::optional<std::size_t> RegimeTrack::index_of(const std::string& name) const noexcept {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found == names_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names_.begin());
}

double RegimeTrack::total_s(std::size_t regime) const noexcept {
  double sum = 0.0;
  for (const auto& s : stretches_) sum += s.regime == regime ? to_seconds(s.end - s.begin) : 0.0;
  return sum;
}

double RegimeTrack::longest_s(std::size_t regime) const noexcept {
  double longest = 0.0;
  for (const auto& s : stretches_) {
    if (s.regime == regime) longest = std::max(longest, to_seconds(s.end - s.begin));
  }
  return longest;
}

}  // namespace imuscope
