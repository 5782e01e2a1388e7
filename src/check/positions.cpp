#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include "check/checks.h"

namespace imuscope::check {

namespace {

/// More than a car's tyres can do (1 g), with room for what a receiver's own filter makes of it.
constexpr double kAccelerationMax_mps2 = 15.0;
/// An honest error is beyond this many sd once in 10^6.
constexpr double kSdMax = 5.0;
/// Neighbours are compared over no more periods than this: after a gap anything may be.
constexpr double kPeriodsMax = 2.5;
constexpr std::size_t kTrackMin = 20;
/// Of a receiver that repeats its last position: so long, ...
constexpr double kFrozen_s = 2.0;
/// ... and then so far away.
constexpr double kFrozenJump_m = 3.0;
/// A receiver stands where its positions keep within so much of a metre a second.
constexpr double kStandingSpeed_mps = 0.05;
/// Errors that a receiver has for longer make its scatter smaller than its sd, never larger.
constexpr double kSdRatioMax = 5.0;

/// A millimetre is what the curvature of the Earth makes of equal digits within a drive.
constexpr double kSameDigits_m = 1e-3;
/// Noise and motion make steps of every size; where the least one is beyond so many sd, digits are missing.
constexpr double kStepSdMax = 5.0;
/// A degree of longitude is shorter farther north: of a digit's step, by so much within a drive ...
constexpr double kMultipleTolerance = 0.005;
/// ... for so many of the steps.
constexpr double kMultiplesShare = 0.9;

/// More positions than this do not jump: they scatter.
constexpr double kJumpsShareMax = 0.1;
/// Rayleigh: the median length of an error of sd 1 north and east.
constexpr double kRayleighMedian = 1.177;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double period_of(const GnssTrack& track) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < track.size(); ++i) steps.push_back(track.time_s[i] - track.time_s[i - 1]);
  return median(steps);
}

void report_sd(const DeviceConfig& config, double sd_m, double claimed_m, std::vector<Finding>& findings) {
  const std::string floor_m = fmt::format("{:.2g}", sd_m);
  findings.push_back({Harm::kLimits,
                      "claimed sd",
                      config.name,
                      "its positions scatter more than their sd says",
                      sd_m,
                      claimed_m,
                      "m",
                      fmt::format("write position_sd_floor_m = {}", floor_m),
                      {{config.name, "position_sd_floor_m", floor_m}}});
}

void check_jumps(const DeviceConfig& config, const GnssTrack& track, double period_s,
                 std::vector<Finding>& findings) {
  std::size_t jumps = 0;
  double largest_m = 0.0;
  std::vector<double> all_m;
  for (std::size_t i = 2; i < track.size(); ++i) {
    const double before_s = track.time_s[i - 1] - track.time_s[i - 2];
    const double after_s = track.time_s[i] - track.time_s[i - 1];
    if (!(before_s > 0.0) || !(after_s > 0.0) || std::max(before_s, after_s) > kPeriodsMax * period_s)
      continue;
    // What goes on as it went, and what vehicle and errors may add to it.
    const double share = after_s / before_s;
    const Eigen::Vector2d expected =
        track.position_m[i - 1] + share * (track.position_m[i - 1] - track.position_m[i - 2]);
    const double off_m = (track.position_m[i] - expected).norm();
    const double by_errors_m =
        kSdMax * track.claimed_sd_m[i] * std::sqrt(1.0 + (1.0 + share) * (1.0 + share) + share * share);
    const double by_motion_m = 0.5 * kAccelerationMax_mps2 * after_s * (after_s + before_s);
    all_m.push_back(off_m);
    if (off_m < by_errors_m + by_motion_m) continue;
    ++jumps;
    largest_m = std::max(largest_m, off_m);
  }
  if (jumps == 0) return;
  // Of even steps: the error of three positions with the weights 1, -2, 1.
  const double sd_m = median(all_m) / (kRayleighMedian * std::sqrt(6.0));
  if (static_cast<double>(jumps) > kJumpsShareMax * static_cast<double>(all_m.size()) &&
      sd_m > track.claimed_sd_m.front()) {
    report_sd(config, sd_m, track.claimed_sd_m.front(), findings);
    return;
  }
  findings.push_back({Harm::kLimits,
                      "position jumps",
                      config.name,
                      "positions jump by more than the vehicle can move and its sd allows",
                      largest_m,
                      0.0,
                      "m",
                      "use the receiver's own sd and solution type; where it lost its "
                      "fix, those positions are refused",
                      {}});
}

/// Steps between positions that differ, along one axis.
std::vector<double> steps_along(const GnssTrack& track, int axis) {
  std::vector<double> steps_m;
  for (std::size_t i = 1; i < track.size(); ++i) {
    const double step_m = std::abs(track.position_m[i][axis] - track.position_m[i - 1][axis]);
    if (step_m >= kSameDigits_m) steps_m.push_back(step_m);
  }
  return steps_m;
}

/// Whether nearly all are multiples of the least of them: digits make such steps, an even speed does not.
bool are_multiples(const std::vector<double>& steps_m, double least_m) {
  const auto whole = std::count_if(steps_m.begin(), steps_m.end(), [&](double step_m) {
    const double nearest_m = least_m * std::round(step_m / least_m);
    return std::abs(step_m - nearest_m) < kSameDigits_m + kMultipleTolerance * nearest_m;
  });
  return static_cast<double>(whole) >= kMultiplesShare * static_cast<double>(steps_m.size());
}

/// Positions with too few digits: nothing between a step and none.
void check_steps(const DeviceConfig& config, const GnssTrack& track, std::vector<Finding>& findings) {
  std::size_t steps = 0;
  double least_m = std::numeric_limits<double>::infinity();
  for (const int axis : {0, 1}) {
    const std::vector<double> steps_m = steps_along(track, axis);
    if (steps_m.empty()) continue;
    const double of_axis_m = *std::min_element(steps_m.begin(), steps_m.end());
    if (!are_multiples(steps_m, of_axis_m)) return;
    steps += steps_m.size();
    least_m = std::min(least_m, of_axis_m);
  }
  if (steps < kTrackMin || !(least_m > kStepSdMax * median(track.claimed_sd_m))) return;
  findings.push_back({Harm::kLimits,
                      "position steps",
                      config.name,
                      "its positions have too few digits: they move in steps",
                      least_m,
                      0.0,
                      "m",
                      "write latitude and longitude with eight decimals (a millimetre)",
                      {}});
}

void check_frozen(const DeviceConfig& config, const GnssTrack& track, std::vector<Finding>& findings) {
  double longest_s = 0.0;
  std::size_t begin = 0;
  for (std::size_t i = 1; i < track.size(); ++i) {
    if (track.position_m[i] == track.position_m[begin]) continue;
    const double held_s = track.time_s[i] - track.time_s[begin];
    const bool came_fast = begin > 0 &&
                           (track.position_m[begin] - track.position_m[begin - 1]).norm() > 0.0 &&
                           (track.position_m[i] - track.position_m[begin]).norm() > kFrozenJump_m;
    if (i > begin + 2 && held_s > kFrozen_s && came_fast) longest_s = std::max(longest_s, held_s);
    begin = i;
  }
  if (longest_s == 0.0) return;
  findings.push_back({Harm::kLimits,
                      "frozen position",
                      config.name,
                      "it repeats its last position while the vehicle moves on",
                      longest_s,
                      0.0,
                      "s",
                      "have it send no position where it has none, and take these rows out of the file",
                      {}});
}

/// Scatter about the line through both neighbours, where the vehicle stands.
void check_claimed_sd(const DeviceConfig& config, const GnssTrack& track, double period_s,
                      std::vector<Finding>& findings) {
  std::vector<double> scatter_m;
  std::vector<double> claimed_m;
  for (std::size_t i = 2; i + 2 < track.size(); ++i) {
    const double span_s = track.time_s[i + 2] - track.time_s[i - 2];
    if (!(span_s > 0.0) || span_s > 2.0 * kPeriodsMax * period_s) continue;
    const double speed_mps = (track.position_m[i + 2] - track.position_m[i - 2]).norm() / span_s;
    const double by_errors_mps = kSdRatioMax * kSdMax * track.claimed_sd_m[i] / span_s;
    if (speed_mps > kStandingSpeed_mps + by_errors_mps) continue;
    const Eigen::Vector2d off =
        track.position_m[i] - 0.5 * (track.position_m[i - 1] + track.position_m[i + 1]);
    scatter_m.push_back(off.norm());
    claimed_m.push_back(track.claimed_sd_m[i]);
  }
  if (scatter_m.size() < kTrackMin) return;
  // The mean of the neighbours adds half of their variance.
  const double sd_m = median(scatter_m) / (kRayleighMedian * std::sqrt(1.5));
  const double claimed = median(claimed_m);
  if (sd_m < kSdRatioMax * claimed) return;
  report_sd(config, sd_m, claimed, findings);
}

}  // namespace

void check_positions(const Drive& drive, std::size_t device, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[device];
  const GnssTrack& track = drive.gnss(device);
  if (track.size() < kTrackMin) return;
  const double period_s = period_of(track);
  const std::size_t before = findings.size();
  check_steps(config, track, findings);
  if (findings.size() > before) return;  // between its steps it would stand, and jump
  check_frozen(config, track, findings);
  if (findings.size() == before) check_claimed_sd(config, track, period_s, findings);
  if (findings.size() == before) check_jumps(config, track, period_s, findings);
}

}  // namespace imuscope::check
