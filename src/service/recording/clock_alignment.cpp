#include "service/recording/clock_alignment.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <optional>

#include "estimation/alignment/cross_correlation.h"

namespace imuscope {

namespace {

/// An offset is good to some milliseconds; over less time than this it says less about a quartz's rate (tens
/// of ppm) than is known beforehand.
constexpr double kClockRateMin_s = 300.0;

struct RateSeries {
  std::vector<double> time_s;
  std::vector<double> rate_radps;
};

RateSeries rate_series(const std::vector<Sample>& samples) {
  RateSeries series;
  for (const auto& sample : samples) {
    if (sample.kind != SampleKind::kImu || (sample.imu.flags & kGyroValid) == 0) continue;
    const auto& w = sample.imu.omega_radps;
    series.time_s.push_back(to_seconds(sample.time.time_since_epoch()));
    series.rate_radps.push_back(std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]));
  }
  return series;
}

/// Clocks that only count begin anywhere: where their times as they stand show no match, the recordings are
/// taken to have begun together.
Result<TimeOffset> find_offset(const RateSeries& reference, const RateSeries& study,
                               const TimeOffsetOptions& options) {
  const RateMagnitudeSeries fixed{reference.time_s, reference.rate_radps};
  auto found = find_time_offset(fixed, {study.time_s, study.rate_radps}, options);
  if (found || study.time_s.empty() || reference.time_s.empty()) return found;
  const double lead_s = reference.time_s.front() - study.time_s.front();
  RateSeries together = study;
  for (double& time_s : together.time_s) time_s += lead_s;
  auto again = find_time_offset(fixed, {together.time_s, together.rate_radps}, options);
  if (!again) return again;
  again->offset_s += lead_s;
  again->study_origin_s -= lead_s;
  return again;
}

Result<DeviceClock> align_by_rate(const std::string& name, const RateSeries& reference,
                                  const std::vector<Sample>& samples) {
  const auto study = rate_series(samples);
  TimeOffsetOptions options;
  options.estimate_clock_rate =
      !study.time_s.empty() && study.time_s.back() - study.time_s.front() >= kClockRateMin_s;
  const auto found = find_offset(reference, study, options);
  if (!found) {
    return work_error(
        fmt::format("{}: its clock cannot be brought to the reference's: {}", name, found.error().what),
        "a drive with turns is needed, or recordings with arrival stamps");
  }
  // t_R = t_S + offset + rate (t_S - origin)  =>  host time of device time 0, and seconds per device second.
  const double origin_s = found->offset_s - found->clock_rate * found->study_origin_s;
  DeviceClock clock;
  clock.map = ClockMapConfig::fixed(HostTime{from_seconds(origin_s)}, 1.0 + found->clock_rate);
  const double mid_s = 0.5 * (study.time_s.front() + study.time_s.back());
  clock.shift_s = origin_s + found->clock_rate * mid_s;
  clock.shift_sd_s = found->sd_s;
  clock.how = fmt::format("angular rate against the reference's (correlation {:.2f}, clock rate {:+.1f} ppm)",
                          found->correlation, found->clock_rate * 1e6);
  return clock;
}

}  // namespace

bool shares_the_reference_clock(const DeviceConfig& device) {
  if (is_message_log(device.protocol)) return device.messages.common_clock;
  const bool csv = traits_of(device.protocol).is_text;
  return csv ? device.csv.common_clock : device.gnss.common_clock;
}

std::optional<Duration> utc_minus_time(const std::vector<Sample>& samples) {
  std::vector<std::int64_t> differences;
  for (const auto& sample : samples) {
    if (sample.has_utc) differences.push_back(to_ns(sample.utc) - to_ns(sample.time));
  }
  if (differences.empty()) return std::nullopt;
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return Duration{*middle};
}

Result<std::vector<DeviceClock>> align_clocks(const Configuration& configuration,
                                              const std::vector<bool>& unstamped, const ReadSamples& read) {
  std::vector<DeviceClock> clocks(configuration.devices.size());
  const auto reference = configuration.reference_index();
  if (!unstamped[reference]) return clocks;
  const auto reference_samples = read(static_cast<DeviceIndex>(reference));
  if (!reference_samples) return tl::unexpected<Error>(reference_samples.error());
  const auto reference_rate = rate_series(*reference_samples);
  const auto reference_utc = utc_minus_time(*reference_samples);
  const auto own_times = ClockMapConfig::fixed(HostTime{}, 1.0);
  clocks[reference] = {own_times, 0.0, 0.0, "the recording's own times, which are the run's"};

  for (std::size_t i = 0; i < configuration.devices.size(); ++i) {
    if (i == reference || !unstamped[i]) continue;
    const auto& device = configuration.devices[i];
    if (shares_the_reference_clock(device)) {
      clocks[i] = {own_times, 0.0, 0.0, "the reference's clock, as configured"};
      continue;
    }
    const auto samples = read(static_cast<DeviceIndex>(i));
    if (!samples) return tl::unexpected<Error>(samples.error());
    const auto utc = utc_minus_time(*samples);
    if (utc && reference_utc) {
      const auto shift = *utc - *reference_utc;
      clocks[i] = {ClockMapConfig::fixed(HostTime{shift}, 1.0), to_seconds(shift), 0.0, "UTC tags"};
      continue;
    }
    if (device.role != DeviceRole::kStudy) {
      return work_error(
          fmt::format("{}: neither UTC tags nor arrival stamps bring it to the reference's time",
                      device.name),
          "set clock = \"common\" (csv.clock of a CSV file) where its times are the reference's");
    }
    auto clock = align_by_rate(device.name, reference_rate, *samples);
    if (!clock) return tl::unexpected<Error>(clock.error());
    clocks[i] = std::move(*clock);
  }
  return clocks;
}

Result<DeviceClock> align_log(const DeviceConfig& device, const LogStamps& stamps,
                              const std::function<Result<std::vector<Sample>>()>& read_reference,
                              const std::function<Result<std::vector<Sample>>()>& read_own) {
  if (stamps.are_the_runs || (device.can && device.can->log_has_common_clock)) {
    return DeviceClock{ClockMapConfig::fixed(HostTime{}, 1.0), 0.0, 0.0,
                       stamps.are_the_runs ? "the log's stamps, which are the run's"
                                           : "the reference's clock, as configured"};
  }
  // The stamps are those of arrivals: brought to the run's scale, nothing of them belongs to the device's
  // clock.
  if (stamps.are_utc && stamps.utc_of_run) {
    return DeviceClock{ClockMapConfig::fixed(HostTime{-*stamps.utc_of_run}, 1.0), 0.0, 0.0,
                       "the log's stamps, taken as UTC"};
  }
  if (device.role != DeviceRole::kStudy) {
    return work_error(
        fmt::format("{}: {}", device.name,
                    stamps.are_utc
                        ? "the log is stamped with UTC, which no other device of the recording tells"
                        : "the stamps of the log are no UTC"),
        "set log_clock = \"common\" in its transport where they are the times of the other recordings");
  }
  const auto reference = read_reference();
  if (!reference) return tl::unexpected<Error>(reference.error());
  const auto samples = read_own();
  if (!samples) return tl::unexpected<Error>(samples.error());
  return align_by_rate(device.name, rate_series(*reference), *samples);
}

}  // namespace imuscope
