#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "check/checks.h"

namespace imuscope::check {

namespace {

/// Of the shorter of two recordings: less of it in common is no common drive.
constexpr double kCommonMin = 0.1;
/// Time zones differ by multiples of a quarter of an hour; a file begins some minutes after another at most.
constexpr double kZoneStep_s = 900.0;
constexpr double kZoneMax_s = 14.0 * 3600.0;
constexpr double kZoneTolerance_s = 120.0;

struct Span {
  double begin_s;
  double end_s;
};

double common_share(const Span& a, const Span& b) {
  const double common = std::min(a.end_s, b.end_s) - std::max(a.begin_s, b.begin_s);
  const double shorter = std::min(a.end_s - a.begin_s, b.end_s - b.begin_s);
  return shorter > 0.0 ? common / shorter : 1.0;
}

/// The whole zone that brings two recordings together; 0 where none does.
double zone_of(const Span& reference, const Span& other) {
  const double zone_s = kZoneStep_s * std::round((reference.begin_s - other.begin_s) / kZoneStep_s);
  if (zone_s == 0.0 || std::abs(zone_s) > kZoneMax_s) return 0.0;
  const double left_s = other.begin_s + zone_s - reference.begin_s;
  return std::abs(left_s) < kZoneTolerance_s ? zone_s : 0.0;
}

}  // namespace

bool check_overlap(Drive& drive, std::size_t device, std::vector<Finding>& findings) {
  const std::size_t reference = drive.configuration().reference_index();
  const DeviceConfig& config = drive.configuration().devices[device];
  const bool gnss = config.role == DeviceRole::kGnss;
  std::vector<double>& time_s = gnss ? drive.gnss(device).time_s : drive.imu(device).time_s;
  const std::vector<double>& reference_s = drive.imu(reference).time_s;
  if (device == reference || drive.time_scale(device) == TimeScale::kOwn) return true;
  if (time_s.size() < 2 || reference_s.size() < 2) return true;
  const Span mine{time_s.front(), time_s.back()};
  const Span other{reference_s.front(), reference_s.back()};
  if (common_share(mine, other) > kCommonMin) return true;
  const double apart_s = mine.begin_s - other.begin_s;
  Finding finding{Harm::kWrong,
                  "other time",
                  config.name,
                  fmt::format("its times are not those of {}: it begins {:.6g} s {}",
                              drive.configuration().devices[reference].name, std::abs(apart_s),
                              apart_s > 0.0 ? "later" : "earlier"),
                  apart_s,
                  0.0,
                  "s",
                  "give both files of one drive, with times of one clock",
                  {}};
  const double zone_s = zone_of(other, mine);
  const bool is_text = traits_of(config.protocol).is_text;
  if (zone_s != 0.0 && is_text) {
    const std::string value = fmt::format("{:.1f}", zone_s + config.csv.time_offset_s);
    finding.what += " (another time zone?)";
    finding.remedy = fmt::format("write time_offset_s = {} in its [device.csv]", value);
    finding.mends.push_back({config.name, "csv.time_offset_s", value});
  } else if (is_text && !gnss) {
    finding.remedy = "write clock = \"own\" in its [device.csv], where both files are of one drive";
    finding.mends.push_back({config.name, "csv.clock", "\"own\""});
  } else if (is_text) {
    finding.remedy += " (time_offset_s in its [device.csv] is added to its times)";
  }
  findings.push_back(std::move(finding));
  for (double& time : time_s) time += zone_s;
  return zone_s != 0.0;
}

}  // namespace imuscope::check
