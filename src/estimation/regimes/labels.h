#pragma once

/// Regimes that a person names: in a file, or while the run goes on by messages on IMUSCOPE_EVENT.

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/time.h"
#include "estimation/regimes/regime_track.h"

namespace imuscope {

/// Longest name of a regime, in bytes.
inline constexpr std::size_t kRegimeNameMax = 64;

/// Begin and end in seconds since the run's first R-IMU epoch (time_s of every file), or since 1970-01-01 UTC
/// (its utc_s).
struct Label {
  double begin_s = 0.0;
  double end_s = 0.0;
  std::string name;
  bool in_utc = false;
};

/// Reads a table begin_s,end_s,regime or begin_utc,end_utc,regime with such a header, # comments allowed,
/// sorted by begin. UTC is written as in 2026-03-14T09:30:00.25Z, or with another zone (+01:00), or in seconds
/// since 1970-01-01. Errors (kUsage): what is wrong and in which line; stretches that overlap; names that are no
/// line of UTF-8 of at most kRegimeNameMax bytes.
Result<std::vector<Label>> parse_labels(std::string_view text, const std::string& file);

/// A moment that a person marked.
struct MarkedMoment {
  HostTime time{};
  std::string text;
};

/// "regime NAME" begins a regime that holds until the next such message, "regime end" ends one. Other texts
/// mark moments and are passed over. The last one holds until `end`. Anybody on the vehicle's network may
/// have sent them: a name becomes one line (base/text.h, one_line()) of at most kRegimeNameMax bytes.
std::vector<Label> labels_of_moments(const std::vector<MarkedMoment>& moments, HostTime origin, HostTime end);

/// The same labels in seconds since `origin`. Error (kUsage): labels in UTC, and the run knows none.
/// @param time_of  the instant of a UTC; nothing where nobody told UTC
Result<std::vector<Label>> labels_of_run(std::vector<Label> labels, HostTime origin,
                                         const std::function<std::optional<HostTime>(UtcTime)>& time_of);

/// Takes out the stretches of all names but the first n_names. Returns how many names that were.
std::size_t keep_first_names(std::vector<Label>& labels, std::size_t n_names);

/// Names in the order in which they first occur.
RegimeTrack labelled_regimes(const std::vector<Label>& labels, HostTime origin);

}  // namespace imuscope
