#pragma once

/// Regimes that a person names: in a file, or while the run goes on by messages on IMUSCOPE_EVENT.

#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/time.h"
#include "regimes/regime_track.h"

namespace imuscope {

/// Begin and end in seconds since the run's first R-IMU epoch (time_s of every file).
struct Label {
  double begin_s = 0.0;
  double end_s = 0.0;
  std::string name;
};

/// Reads a table begin_s,end_s,regime with this header, # comments allowed, sorted by begin. Errors (kUsage):
/// what is wrong and in which line; stretches that overlap.
Result<std::vector<Label>> parse_labels(std::string_view text, const std::string& file);

/// A moment that a person marked.
struct MarkedMoment {
  HostTime time{};
  std::string text;
};

/// "regime NAME" begins a regime that holds until the next such message, "regime end" ends one. Other texts
/// mark moments and are passed over. The last one holds until `end`.
std::vector<Label> labels_of_moments(const std::vector<MarkedMoment>& moments, HostTime origin, HostTime end);

/// Names in the order in which they first occur.
RegimeTrack labelled_regimes(const std::vector<Label>& labels, HostTime origin);

}  // namespace imuscope
