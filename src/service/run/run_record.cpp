#include "service/run/run_record.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/units.h"
#include "service/run/describe.h"
#include "service/run/health.h"
#include "service/run/run_folder.h"

namespace imuscope {

namespace {

/// Where the antenna was found to be, and how late the receiver's solutions are.
nlohmann::json antenna_json(const NavigationOutput& found) {
  return {{"lever_arm_b_m", found.antenna_lever_arm_b_m},
          {"lever_arm_sd_m", found.sd_antenna_lever_arm_m},
          {"latency_s", found.receiver_latency_s},
          {"latency_sd_s", found.sd_receiver_latency_s}};
}

std::string utc_text(UtcTime utc) {
  const auto whole = std::chrono::round<std::chrono::microseconds>(utc);
  const auto since_epoch = std::chrono::floor<std::chrono::seconds>(whole);
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:06}Z", fmt::gmtime(since_epoch.time_since_epoch().count()),
                     (whole - since_epoch).count());
}

/// A number, or null where it is unknown.
nlohmann::json known(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json time_budget_json(const TimeBudget& budget) {
  return {{"stamped_by", name_of(budget.stamped_by)},
          {"stamp_lead_s", known(budget.stamp_lead_s)},
          {"stamp_lead_sd_s", known(budget.stamp_lead_sd_s)},
          {"delay_s", known(budget.delay_s)},
          {"sd_delay_s", known(budget.sd_delay_s)},
          {"wire_s", budget.wire_s},
          {"adapter_s", budget.adapter_s},
          {"latency_s", known(budget.latency_s)},
          {"clock_sd_s", known(budget.clock_sd_s)},
          {"clock_drift_ppm", known(budget.clock_drift_ppm)},
          {"t_d_s", known(budget.t_d_s)},
          {"sd_t_d_s", known(budget.sd_t_d_s)}};
}

/// What the maker says of an S-IMU, as the configuration has it; null where it says nothing.
nlohmann::json data_sheet_json(const DataSheetConfig& sheet) {
  nlohmann::json json = nlohmann::json::object();
  const auto say = [&](const char* key, const std::optional<double>& value, double unit) {
    if (value) json[key] = *value / unit;
  };
  say("gyro_density_degps_per_sqrt_hz", sheet.gyro_density_radps_per_sqrt_hz, kRadPerDeg);
  say("gyro_bias_stability_deg_per_h", sheet.gyro_bias_stability_radps, kRadPerDeg / kSecondsPerHour);
  say("accel_density_ug_per_sqrt_hz", sheet.accel_density_mps2_per_sqrt_hz, kMps2PerMicroG);
  say("accel_bias_stability_ug", sheet.accel_bias_stability_mps2, kMps2PerMicroG);
  return json.empty() ? nlohmann::json(nullptr) : json;
}

nlohmann::json device_json(const RunRecord& run, std::size_t i) {
  const auto& device = run.configuration.devices[i];
  const DeviceRecord& record = run.devices[i];
  const auto& counters = record.counters;
  nlohmann::json entry{{"name", device.name},
                       {"role", name_of(device.role)},
                       {"protocol", name_of(device.protocol)},
                       {"rate_hz", device.rate_hz},
                       {"samples", counters.samples},
                       {"frames", counters.frames},
                       {"bytes", counters.bytes},
                       {"bytes_skipped", counters.bytes_skipped},
                       {"bad_checksums", counters.bad_checksums},
                       {"bad_lengths", counters.bad_lengths},
                       {"bad_contents", counters.bad_contents},
                       {"samples_lost", counters.samples_lost},
                       {"clock_resets", counters.clock_resets},
                       {"frames_dropped", record.frames_dropped},
                       {"refused", record.refused},
                       {"problem", record.problem},
                       {"clock", record.clock},
                       {"clock_shift_s", record.clock_shift_s}};
  const auto studies = run.configuration.study_indices();
  const auto found = std::find(studies.begin(), studies.end(), i);
  const bool is_study = found != studies.end() && run.last != nullptr;
  entry["late"] = nullptr;
  if (is_study) {
    const SImuCounters& study = run.last->studies[static_cast<std::size_t>(found - studies.begin())].counters;
    entry["late"] = study.late + study.refused_full;
    entry["waiting"] = study.waiting;
  }
  if (device.role == DeviceRole::kGnss && run.last != nullptr && run.last->navigation.has_gnss)
    entry["antenna"] = antenna_json(run.last->navigation);
  if (device.role == DeviceRole::kStudy) entry["data_sheet"] = data_sheet_json(device.data_sheet);
  if (record.time_budget) entry["time_budget"] = time_budget_json(*record.time_budget);
  return entry;
}

/// What was learned of the wheels, and what became of their speeds.
nlohmann::json odometry_json(const Snapshot& last) {
  const OdometryOutput& out = last.odometry;
  const EstimatorCounters& counters = last.counters;
  const auto degrees = [](const Vector3& v) {
    return nlohmann::json{v[0] * kDegPerRad, v[1] * kDegPerRad, v[2] * kDegPerRad};
  };
  return {{"scale", out.scale},
          {"scale_sd", out.sd_scale},
          {"mounting_rotation_vector_deg", degrees(out.mount_rad)},
          {"mounting_sd_deg", degrees(out.sd_mount_rad)},
          {"axle_lever_arm_b_m", out.r_bv_b_m},
          {"axle_lever_arm_sd_m", out.sd_r_bv_b_m},
          {"nis", {{"speed", out.nis[0]}, {"sideways", out.nis[1]}, {"upwards", out.nis[2]}}},
          {"samples", counters.odometry_samples},
          {"speed_used", counters.odometry_speed_used},
          {"speed_rejected", counters.odometry_speed_rejected},
          {"non_holonomic_used", counters.odometry_slip_used},
          {"non_holonomic_rejected", counters.odometry_slip_rejected},
          {"zero_velocity_used", counters.zero_velocity_used},
          {"zero_velocity_rejected", counters.zero_velocity_rejected},
          {"too_old", counters.odometry_too_old},
          {"not_finite", counters.odometry_not_finite}};
}

/// What the receiver says and what the vehicle does do not fit: everything else rests on both.
bool contradicts_motion(const EstimatorCounters& counters) {
  // Of honest sd the gate refuses about one position in a thousand.
  constexpr double kRefusedShareMax = 0.05;
  return static_cast<double>(counters.gnss_positions_rejected) >
         kRefusedShareMax * static_cast<double>(counters.gnss_used + counters.gnss_rejected);
}

nlohmann::json gnss_json(const EstimatorCounters& counters) {
  return {{"used", counters.gnss_used},
          {"rejected", counters.gnss_rejected},
          {"positions_rejected", counters.gnss_positions_rejected},
          {"contradicts_motion", contradicts_motion(counters)}};
}

nlohmann::json delay_json(const StreamDelay& delay) {
  return {{"mean_s", known(delay.mean_s)}, {"sd_s", known(delay.sd_s)}};
}

/// The host's clock by pulses; null where none came.
nlohmann::json pulses_json(const PulseState& pulses) {
  if (!pulses.is_known) return nullptr;
  return {{"used", pulses.used},
          {"left_out", pulses.left_out},
          {"seconds_counted_by", pulses.counted_by_pc_clock ? "pc" : "device"},
          {"sd_utc_s", pulses.sd_utc_s},
          {"jitter_s", pulses.jitter_s},
          {"host_clock_ppm", -1e6 * pulses.rate},
          {"sd_rate_ppm", 1e6 * pulses.sd_rate},
          {"reference_delay", delay_json(pulses.reference_delay)},
          {"gnss_delay", delay_json(pulses.gnss_delay)}};
}

/// Whose seconds the run's rates were integrated over ("host": no device told UTC), and where the UTC of its
/// rows comes from.
nlohmann::json time_scale_json(const Snapshot* last) {
  const TimeScale scale = last != nullptr ? last->time_scale : TimeScale{};
  const bool told = is_told_by_device(scale.source);
  nlohmann::json json{{"seconds_of", told ? name_of(scale.source) : "host"},
                      {"sd_rate_ppm", 1e6 * scale.sd_rate},
                      {"utc_from", name_of(scale.source)},
                      {"sd_utc_s", nullptr},
                      {"pulses", pulses_json(scale.pulses)}};
  if (!told) return json;
  json["host_clock_ppm"] = -1e6 * scale.rate;
  json["sd_utc_s"] = scale.sd_utc_s;
  json["gps_minus_utc_s"] = scale.gps_minus_utc_s;
  json["steps"] = scale.steps;
  return json;
}

nlohmann::json keeper_json(const ClockKeeper& keeper) {
  return {{"name", keeper.name},
          {"source", keeper.source},
          {"stratum", keeper.stratum < 0 ? nlohmann::json(nullptr) : nlohmann::json(keeper.stratum)},
          {"is_synchronised", keeper.is_synchronised},
          {"offset_s", known(keeper.offset_s)},
          {"sd_s", known(keeper.sd_s)},
          {"max_error_s", known(keeper.max_error_s)},
          {"frequency_ppm", known(keeper.frequency_ppm)}};
}

nlohmann::json kernel_clock_json(const PcClockRecord::State& state) {
  nlohmann::json json{
      {"wall", utc_text(state.reading.wall)}, {"kernel", nullptr}, {"keepers", nlohmann::json::array()}};
  for (const ClockKeeper& keeper : state.keepers) json["keepers"].push_back(keeper_json(keeper));
  if (!state.kernel) return json;
  const KernelClockState& kernel = *state.kernel;
  json["kernel"] = {{"is_synchronised", kernel.is_synchronised},
                    {"status", kernel.status},
                    {"offset_s", kernel.offset_s},
                    {"frequency_ppm", kernel.frequency_ppm},
                    {"max_error_s", kernel.max_error_s},
                    {"estimated_error_s", kernel.estimated_error_s},
                    {"tai_minus_utc_s", kernel.tai_minus_utc_s}};
  return json;
}

/// The wall clock of the PC that recorded: who sets it, how well, and where it was stepped.
nlohmann::json pc_clock_json(const PcClockRecord& clock, const Snapshot* last) {
  nlohmann::json json{{"first", nullptr}, {"last", nullptr}, {"steps", nlohmann::json::array()}};
  if (clock.first) json["first"] = kernel_clock_json(*clock.first);
  if (clock.last) json["last"] = kernel_clock_json(*clock.last);
  const auto time_s = [&](HostTime time) {
    return last != nullptr ? to_seconds(time - last->first_reference_time) : 0.0;
  };
  for (const WallClockStep& step : clock.steps) {
    json["steps"].push_back({{"after_time_s", time_s(step.after)},
                             {"before_time_s", time_s(step.before)},
                             {"size_s", step.size_s}});
  }
  json["steps_left_out"] = clock.steps_left_out;
  json["suspends"] = nlohmann::json::array();
  for (const PcSuspend& suspend : clock.suspends) {
    json["suspends"].push_back({{"after_time_s", time_s(suspend.after)},
                                {"before_time_s", time_s(suspend.before)},
                                {"length_s", suspend.length_s}});
  }
  return json;
}

/// Navigation alone integrates; a mounting does not depend on the length of a second.
void warn_of_host_seconds(const Snapshot& last, std::vector<std::string>& warnings) {
  if (is_told_by_device(last.time_scale.source)) return;
  if (last.navigation.status != NavigationStatus::kNavigating) return;
  warnings.push_back(
      "no device tells UTC: rates were integrated over seconds of the arrivals' clock, which may be wrong by "
      "50 ppm, and headings err by as much of every turn");
}

/// GNSS was given, and there is no position: says what was missing.
void warn_of_no_navigation(const Configuration& configuration, const Snapshot& last,
                           std::vector<std::string>& warnings) {
  const auto gnss = configuration.gnss_index();
  const NavigationStatus status = last.navigation.status;
  if (!gnss || status == NavigationStatus::kNotOffered || status == NavigationStatus::kNavigating) return;
  const char* why =
      status == NavigationStatus::kAligning
          ? "the vehicle's heading was not found: it shows in the reference's own attitude, in a "
            "minute of rest with a reference that feels the Earth turn, or in braking and "
            "turning between good positions"
          : "the vehicle never stood still for two seconds, which levelling takes, or no position came";
  warnings.push_back(
      fmt::format("{}: the navigation did not start: {}; mountings do not need it, positions and speeds do",
                  configuration.devices[*gnss].name, why));
}

/// The likeliest reason why good positions are refused, where it is one.
const char* taken_for_navigation_grade(const Configuration& configuration) {
  const ImuNoiseConfig& noise = configuration.devices[configuration.reference_index()].noise;
  if (noise.gyro_white_sd_radps && noise.gyro_bias_sd_radps) return "";
  return "without [device.noise] the navigation takes the reference for navigation grade: if it is not, write what "
         "its data sheet says; else ";
}

}  // namespace

std::vector<std::string> warnings_of(const Configuration& configuration, const Snapshot& last) {
  std::vector<std::string> warnings;
  const EstimatorCounters& counters = last.counters;
  if (const auto gnss = configuration.gnss_index(); gnss && contradicts_motion(counters)) {
    warnings.push_back(fmt::format(
        "{}: {} of {} positions were refused, as they contradict the motion; {}check whose clock its "
        "times are of (GPS time is 18 s ahead of UTC), antenna_lever_arm_b_m and the receiver's sd, "
        "and do not trust this run's navigation until then",
        configuration.devices[*gnss].name, counters.gnss_positions_rejected,
        counters.gnss_used + counters.gnss_rejected, taken_for_navigation_grade(configuration)));
  }
  warn_of_host_seconds(last, warnings);
  warn_of_no_navigation(configuration, last, warnings);
  const auto indices = configuration.study_indices();
  for (std::size_t i = 0; i < last.n_studies; ++i) {
    if (has_estimate(last.studies[i].status)) continue;
    warnings.push_back(
        fmt::format("{}: no mounting was found; it needs about a minute of driving with turns, or a "
                    "[device.prior] in the configuration",
                    configuration.devices[indices[i]].name));
  }
  return warnings;
}

nlohmann::json findings_json(const std::vector<check::Finding>& findings) {
  auto json = nlohmann::json::array();
  for (const check::Finding& finding : findings) {
    auto mends = nlohmann::json::array();
    for (const check::ConfigLine& line : finding.mends)
      mends.push_back({{"device", line.device}, {"key", line.key}, {"value", line.value}});
    json.push_back({{"harm", check::key_of(finding.harm)},
                    {"check", finding.check},
                    {"device", finding.device},
                    {"what", finding.what},
                    {"value", finding.value},
                    {"expected", finding.expected},
                    {"unit", finding.unit},
                    {"remedy", finding.remedy},
                    {"mends", std::move(mends)},
                    {"text", check::sentence(finding)}});
  }
  return json;
}

nlohmann::json run_json(const RunRecord& run) {
  nlohmann::json json{{"schema", "imuscope.run/1"},
                      {"name", run.configuration.run_name},
                      {"version", run.version},
                      {"build", fmt::format("{} {}", __VERSION__, sizeof(void*) == 8 ? "64 bit" : "32 bit")},
                      {"configuration", run.configuration.file.filename().string()},
                      {"configuration_sha256", run.configuration.sha256},
                      {"configuration_text", run.configuration.text},
                      {"inputs", run.inputs},
                      {"ticks", run.ticks},
                      {"duration_s", static_cast<double>(run.ticks) / kTickRate_hz},
                      {"findings", run.findings ? findings_json(*run.findings) : nlohmann::json(nullptr)},
                      {"warnings", run.warnings},
                      {"notes", run.notes}};
  json["t0_utc"] = run.last != nullptr && run.last->has_utc
                       ? nlohmann::json(utc_text(run.last->first_reference_utc))
                       : nlohmann::json(nullptr);
  json["time_scale"] = time_scale_json(run.last);
  if (run.pc_clock != nullptr) json["pc_clock"] = pc_clock_json(*run.pc_clock, run.last);
  if (run.static_s && run.dynamic_s)
    json["regimes"] = {{"static_s", *run.static_s}, {"dynamic_s", *run.dynamic_s}};
  json["devices"] = nlohmann::json::array();
  for (std::size_t i = 0; i < run.configuration.devices.size(); ++i)
    json["devices"].push_back(device_json(run, i));
  if (run.last != nullptr && run.configuration.gnss_index()) json["gnss"] = gnss_json(run.last->counters);
  if (run.last != nullptr && run.last->odometry.enabled) json["odometry"] = odometry_json(*run.last);
  json["events"] = nlohmann::json::array();
  for (const auto& event : run.events) {
    const UtcStamp utc = run.utc != nullptr ? run.utc->at(event.time) : UtcStamp{};
    json["events"].push_back(
        {{"time_s", run.last != nullptr ? to_seconds(event.time - run.last->first_reference_time) : 0.0},
         {"utc", utc.is_known ? nlohmann::json(utc_text(utc.utc)) : nlohmann::json(nullptr)},
         {"text", describe(run.configuration, event)}});
  }
  if (!run.error_process_mounting.empty()) json["error_process_mounting"] = run.error_process_mounting;
  return json;
}

Result<void> write_run_record(const OutputFolder& folder, const RunRecord& run) {
  return write_json(folder, "run.json", run_json(run));
}

}  // namespace imuscope
