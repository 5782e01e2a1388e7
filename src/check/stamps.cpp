#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "check/checks.h"
#include "configuration/protocols.h"

namespace imuscope::check {

namespace {

/// A step of more periods than this is a gap, as for the reference window (estimation/alignment/reference_window.h).
constexpr double kGapPeriods = 1.5;
/// Oscillators of MEMS sensors keep their rate to a few per cent; a density goes with its root, so that a
/// tenth is 5 % of it, which short records do not know better.
constexpr double kRateTolerance = 0.1;
/// A receiver's rate serves to size buffers alone.
constexpr double kGnssRateFactor = 1.5;
/// So much of a drive may be lost before its results suffer: the sd grow by half of it.
constexpr double kLostShareMax = 0.02;
/// The filter starts an S-IMU's states again after a silence of some seconds.
constexpr double kLongGap_s = 2.0;
/// Two samples of six numbers are the same by chance only where all six are quantised beyond their noise.
constexpr double kRepeatedShareMax = 0.05;
constexpr std::size_t kStampsMin = 50;
constexpr double kTimeUnitTolerance = 0.1;

struct Steps {
  double median_s = 0.0;
  double rate_hz = 0.0;     ///< between gaps
  double lost_share = 0.0;  ///< of the time, in gaps
  double longest_s = 0.0;
  double same_share = 0.0;  ///< of steps of no time at all
};

Steps steps_of(const std::vector<double>& time_s) {
  std::vector<double> steps;
  steps.reserve(time_s.size());
  Steps out;
  for (std::size_t i = 1; i < time_s.size(); ++i) steps.push_back(time_s[i] - time_s[i - 1]);
  std::vector<double> sorted = steps;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  out.median_s = *middle;
  double time = 0.0;
  double count = 0.0;
  double lost = 0.0;
  double same = 0.0;
  for (const double step : steps) {
    out.longest_s = std::max(out.longest_s, step);
    if (!(step > 0.0)) same += 1.0;
    if (step > kGapPeriods * out.median_s && out.median_s > 0.0) {
      lost += step - out.median_s;
      continue;
    }
    time += step;
    count += 1.0;
  }
  const double span = time_s.back() - time_s.front();
  out.rate_hz = time > 0.0 ? count / time : 0.0;
  out.lost_share = span > 0.0 ? lost / span : 0.0;
  out.same_share = same / static_cast<double>(steps.size());
  return out;
}

/// Stamps in a smaller unit than seconds, by the factor that they are too slow.
const char* time_unit(double factor, double& seconds) {
  struct Unit {
    double seconds;
    const char* name;
  };
  constexpr std::array kUnits{Unit{1e-3, "milliseconds"}, Unit{1e-6, "microseconds"},
                              Unit{1e-9, "nanoseconds"}};
  for (const auto& unit : kUnits) {
    if (std::abs(factor * unit.seconds - 1.0) > kTimeUnitTolerance) continue;
    seconds = unit.seconds;
    return unit.name;
  }
  return nullptr;
}

void scale_times(Drive& drive, std::size_t device, double factor) {
  for (double& time : drive.imu(device).time_s) time *= factor;
  for (double& time : drive.gnss(device).time_s) time *= factor;
}

void check_rate(Drive& drive, std::size_t device, const Steps& steps, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[device];
  const bool gnss = config.role == DeviceRole::kGnss;
  const double ratio = steps.rate_hz / config.rate_hz;
  const double tolerance = gnss ? kGnssRateFactor : 1.0 + kRateTolerance;
  if (ratio < tolerance && ratio > 1.0 / tolerance) return;
  Finding finding{gnss ? Harm::kLimits : Harm::kWrong,
                  "rate",
                  config.name,
                  {},
                  steps.rate_hz,
                  config.rate_hz,
                  "Hz",
                  {},
                  {}};
  double seconds = 1.0;
  if (const char* unit = time_unit(1.0 / ratio, seconds); unit != nullptr) {
    finding.harm = Harm::kWrong;
    finding.check = "time unit";
    finding.what = fmt::format("its times are in {}, read as seconds", unit);
    finding.remedy = fmt::format("write time_unit_s = {:g} in its [device.csv]", seconds);
    if (traits_of(config.protocol).is_text)
      finding.mends.push_back({config.name, "csv.time_unit_s", fmt::format("{:g}", seconds)});
    scale_times(drive, device, seconds);
  } else {
    const double rounded = steps.rate_hz > 10.0 ? std::round(steps.rate_hz) : steps.rate_hz;
    finding.what = "its samples do not come at the rate that is configured";
    finding.remedy = fmt::format("write rate_hz = {:.4g}", rounded);
    finding.mends.push_back({config.name, "rate_hz", fmt::format("{:.4g}", rounded)});
    if (config.rate_hz > 0.0 && finding.mends.back().value.find('.') == std::string::npos)
      finding.mends.back().value += ".0";
  }
  findings.push_back(std::move(finding));
}

bool rate_matches(double rate_hz, const DeviceConfig& config) {
  const double ratio = rate_hz / config.rate_hz;
  return ratio < 1.0 + kRateTolerance && ratio > 1.0 / (1.0 + kRateTolerance);
}

void check_gaps(const DeviceConfig& config, const Steps& steps, std::vector<Finding>& findings) {
  if (config.role == DeviceRole::kGnss) return;  // of a receiver, tunnels have their say
  if (steps.lost_share < kLostShareMax && steps.longest_s < kLongGap_s) return;
  const bool one = steps.lost_share < kLostShareMax;
  findings.push_back(
      {Harm::kLimits,
       "missing samples",
       config.name,
       one ? "its samples stop in between" : "it misses samples",
       one ? steps.longest_s : 100.0 * steps.lost_share,
       0.0,
       one ? "s" : "% of the time",
       "look at its cable, baud rate, buffers of the logger and load of the PC; record again where the "
       "gaps cover what is to be studied",
       {}});
}

void check_repetitions(const DeviceConfig& config, const ImuTrack& track, const Steps& steps,
                       std::vector<Finding>& findings) {
  double repeated = 0.0;
  for (std::size_t i = 1; i < track.size(); ++i) {
    if (track.omega_radps[i] == track.omega_radps[i - 1] && track.f_mps2[i] == track.f_mps2[i - 1])
      repeated += 1.0;
  }
  const double share = repeated / static_cast<double>(track.size() - 1);
  if (share < kRepeatedShareMax && steps.same_share < kRepeatedShareMax) return;
  // A rate that is as configured without its repetitions is no second mistake.
  if (!rate_matches(steps.rate_hz, config) && rate_matches(steps.rate_hz * (1.0 - share), config)) {
    std::erase_if(findings, [&](const Finding& finding) {
      return finding.device == config.name && finding.check == "rate";
    });
  }
  Finding finding{
      Harm::kWrong, "repeated samples", config.name, {}, 100.0 * std::max(share, steps.same_share),
      0.0,          "% of the samples", {},          {}};
  const double rate_hz = steps.rate_hz * (1.0 - share);
  if (share >= kRepeatedShareMax) {
    finding.what = "samples are repeated: it was logged faster than it measures";
    finding.remedy = fmt::format("take the repetitions out of the file and write rate_hz = {:.4g}", rate_hz);
    if (rate_matches(rate_hz, config)) finding.remedy = "take the repetitions out of the file";
  } else {
    finding.what = "several samples have the same time";
    finding.remedy = "let the logger write the time of each sample, with all of its digits";
  }
  findings.push_back(std::move(finding));
}

/// A device whose samples all have one time, such as messages whose stamps nobody filled in.
void report_standing(const DeviceConfig& config, std::size_t samples, std::vector<Finding>& findings) {
  Finding finding{Harm::kWrong,
                  kStandingStamps,
                  config.name,
                  "all of its samples have the same time",
                  static_cast<double>(samples),
                  0.0,
                  "samples",
                  "let the logger write the time of each sample",
                  {}};
  if (is_message_log(config.protocol)) {
    finding.remedy = "write time = \"log\" in its [device.messages], to take the times of their recording";
    finding.mends.push_back({config.name, "messages.time", "\"log\""});
  }
  findings.push_back(std::move(finding));
}

void check_counter(const DeviceConfig& config, const ImuTrack& track, std::vector<Finding>& findings) {
  const std::int64_t span = track.counter.back() - track.counter.front();
  std::int64_t lost = 0;
  for (std::size_t i = 1; i < track.size(); ++i)
    lost += std::max<std::int64_t>(track.counter[i] - track.counter[i - 1] - 1, 0);
  if (span <= 0) return;
  const double share = static_cast<double>(lost) / static_cast<double>(span);
  if (share < kLostShareMax) return;
  findings.push_back({Harm::kLimits,
                      "missing samples",
                      config.name,
                      "its counter says that samples are missing",
                      100.0 * share,
                      0.0,
                      "% of the samples",
                      "look at its cable, baud rate and load of the PC",
                      {}});
}

/// Where each of two IMUs has the other's rate, it has the other's file.
bool rates_exchanged(const Drive& drive, std::size_t one, std::size_t other) {
  const auto& devices = drive.configuration().devices;
  const auto& [a, b] = std::tie(drive.imu(one).time_s, drive.imu(other).time_s);
  if (a.size() < kStampsMin || b.size() < kStampsMin) return false;
  const double a_hz = steps_of(a).rate_hz;
  const double b_hz = steps_of(b).rate_hz;
  return !rate_matches(a_hz, devices[one]) && !rate_matches(b_hz, devices[other]) &&
         rate_matches(a_hz, devices[other]) && rate_matches(b_hz, devices[one]);
}

}  // namespace

bool check_files(const Drive& drive, std::vector<Finding>& findings) {
  const std::size_t reference = drive.configuration().reference_index();
  const std::string& name = drive.configuration().devices[reference].name;
  for (const std::size_t study : drive.configuration().study_indices()) {
    if (!rates_exchanged(drive, reference, study)) continue;
    const DeviceConfig& config = drive.configuration().devices[study];
    std::erase_if(findings, [&](const Finding& finding) {
      return finding.check == "rate" && (finding.device == config.name || finding.device == name);
    });
    findings.push_back({Harm::kWrong,
                        "exchanged files",
                        config.name,
                        fmt::format("its file and that of {} are exchanged: each has the other's rate", name),
                        steps_of(drive.imu(study).time_s).rate_hz,
                        config.rate_hz,
                        "Hz",
                        "exchange the two files where they are given",
                        {}});
    return true;
  }
  return false;
}

void check_stamps(Drive& drive, std::size_t device, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[device];
  const bool gnss = config.role == DeviceRole::kGnss;
  const auto& time_s = gnss ? drive.gnss(device).time_s : drive.imu(device).time_s;
  if (time_s.size() < kStampsMin) return;
  const Steps as_read = steps_of(time_s);
  if (!(time_s.back() > time_s.front())) report_standing(config, time_s.size(), findings);
  if (!(as_read.rate_hz > 0.0)) return;
  check_rate(drive, device, as_read, findings);
  // Of times whose unit was put right: a millisecond read as a second is no gap.
  const Steps steps = steps_of(time_s);
  const std::size_t before = findings.size();
  if (!gnss) check_repetitions(config, drive.imu(device), steps, findings);
  if (!gnss && findings.size() == before) check_counter(config, drive.imu(device), findings);
  if (findings.size() == before) check_gaps(config, steps, findings);
}

}  // namespace imuscope::check
