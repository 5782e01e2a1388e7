#include "study/temperature_track.h"

#include <chrono>
#include <cmath>

namespace imuscope {
namespace {

std::int64_t second_of(HostTime time) {
  return std::chrono::floor<std::chrono::seconds>(time.time_since_epoch()).count();
}

}  // namespace

void TemperatureTrack::add(HostTime time, double temperature_degC) {
  if (!std::isfinite(temperature_degC)) return;
  Cell& cell = cells_[second_of(time)];
  cell.sum += temperature_degC;
  cell.n += 1.0;
}

std::optional<double> TemperatureTrack::mean(HostTime begin, HostTime end) const {
  Cell all;
  for (auto it = cells_.lower_bound(second_of(begin)); it != cells_.end() && it->first <= second_of(end);
       ++it) {
    all.sum += it->second.sum;
    all.n += it->second.n;
  }
  return all.n > 0.0 ? std::optional(all.sum / all.n) : std::nullopt;
}

}  // namespace imuscope
