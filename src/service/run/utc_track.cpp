#include "service/run/utc_track.h"

#include <algorithm>

namespace imuscope {

namespace {

constexpr Duration kEvery = std::chrono::seconds{1};
/// Between two tags UTC steps where it is further off the line than this.
constexpr Duration kStep = std::chrono::milliseconds{10};

/// A receiver's delay counts as found where it is known so many times better than at first.
constexpr double kFound = 10.0;

/// The line of the better one holds before it began, too: messages of a receiver tell UTC late by a delay
/// that nobody tells until motion shows it, and the PC's clock by anything.
bool is_worse(const TimeScale& first, const TimeScale& before, const TimeScale& now) {
  if (before.source == UtcSource::kPcClock) return now.source != UtcSource::kPcClock;
  if (before.source != UtcSource::kGnss) return false;
  if (now.source == UtcSource::kPulses) return true;
  return now.source == UtcSource::kGnss && first.sd_utc_s > kFound * now.sd_utc_s;
}

}  // namespace

void UtcTrack::add(const TimeScale& scale) {
  if (scale.source == UtcSource::kNone) return;
  if (!scales_.empty() && is_worse(scales_.front(), scales_.back(), scale)) scales_.clear();
  if (scales_.size() < 2 || scales_.back().time - scales_[scales_.size() - 2].time >= kEvery) {
    if (scales_.empty() || scale.time > scales_.back().time) scales_.push_back(scale);
  } else {
    scales_.back() = scale;
  }
}

UtcStamp UtcTrack::at(HostTime time) const {
  if (scales_.empty()) return {};
  const auto after = std::upper_bound(scales_.begin(), scales_.end(), time,
                                      [](HostTime t, const TimeScale& scale) { return t < scale.time; });
  if (after == scales_.begin()) return scales_.front().at(time);
  if (after == scales_.end()) return scales_.back().at(time);
  const TimeScale& a = *(after - 1);
  const TimeScale& b = *after;
  const Duration gained = (b.utc - a.utc) - (b.time - a.time);
  if (std::chrono::abs(gained) > kStep) return a.at(time);
  const double share = to_seconds(time - a.time) / to_seconds(b.time - a.time);
  return {a.utc + (time - a.time) + from_seconds(share * to_seconds(gained)), a.gps_minus_utc_s, true};
}

std::optional<HostTime> UtcTrack::time_of(UtcTime utc) const {
  if (scales_.empty()) return std::nullopt;
  const auto after =
      std::find_if(scales_.begin(), scales_.end(), [utc](const TimeScale& scale) { return scale.utc > utc; });
  const TimeScale& near = after == scales_.begin() ? *after : *(after - 1);
  // The line is steep by ppm: two steps find the instant to the nanosecond.
  HostTime time = near.time + (utc - near.utc);
  for (int i = 0; i < 2; ++i) time += utc - at(time).utc;
  return time;
}

}  // namespace imuscope
