#include "service/study.h"

#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/units.h"
#include "error_process/row_low_pass.h"
#include "service/dependence_study.h"
#include "service/dynamics_files.h"
#include "service/estimator_setup.h"
#include "service/modeller.h"
#include "service/noise_series.h"
#include "service/noise_study.h"
#include "service/regime_study.h"
#include "service/replay_broadcast.h"
#include "service/smoothing.h"

namespace imuscope {

namespace {

std::string utc_text(UtcTime utc) {
  const auto since_epoch = std::chrono::floor<std::chrono::seconds>(utc);
  const std::chrono::year_month_day date(std::chrono::floor<std::chrono::days>(since_epoch));
  const std::chrono::hh_mm_ss time(since_epoch - std::chrono::floor<std::chrono::days>(since_epoch));
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                     time.hours().count(), time.minutes().count(), time.seconds().count());
}

/// Rows of the last pass: mounting frozen at its final value, the reference compensated with its smoothed
/// biases, the whole drive covered.
class ErrorCollector final : public CoreSink {
 public:
  /// @param former    mountings that the rows leave out; must outlive the collector, as must what follows
  /// @param rows      one spool a S-IMU
  /// @param low_pass  one a S-IMU, or none
  ErrorCollector(const FormerMountings& former, const ReferenceBiasTrack& biases, std::vector<RowSpool>& rows,
                 std::vector<RowLowPass> low_pass)
      : former_(former),
        biases_(biases),
        rows_(rows),
        low_pass_(std::move(low_pass)),
        temperatures_(rows.size()) {}

  void on_epoch(const StudyEpoch& epoch, HostTime) noexcept override {
    const ReferenceBias bias = biases_.at(epoch.time + from_seconds(epoch.t_d_s));
    watch_.add(epoch, bias);
    if ((epoch.sample.flags & kHasTemperature) != 0)
      temperatures_[epoch.study].add(epoch.time, epoch.sample.temperature_degC);
    if (!is_final_mounting(former_[epoch.study], epoch.time)) return;
    ErrorRow row = error_row(epoch, {epoch.C_b_s, epoch.r_bs_b_m}, bias);
    if (!low_pass_.empty()) low_pass_[epoch.study].apply(row);
    rows_[epoch.study].add(row);
  }
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot& snapshot) noexcept override { watch_.add(snapshot); }
  void on_late_sample(const LateSample&) noexcept override {}

  [[nodiscard]] const MotionWatch& watch() const { return watch_; }
  [[nodiscard]] const std::vector<TemperatureTrack>& temperatures() const { return temperatures_; }

 private:
  const FormerMountings& former_;
  const ReferenceBiasTrack& biases_;
  std::vector<RowSpool>& rows_;
  std::vector<RowLowPass> low_pass_;
  MotionWatch watch_;
  std::vector<TemperatureTrack> temperatures_;
};

/// First pass: everything but errors goes to the folder.
class CalibrationPass final : public CoreSink {
 public:
  CalibrationPass(RunFolder& folder, const Configuration& configuration)
      : folder_(folder), studies_(configuration.study_indices()), former_(studies_.size()) {}
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent& event) noexcept override {
    folder_.on_event(event);
    if (event.kind != EstimatorEventKind::kMountingChanged || !folder_.last_snapshot()) return;
    const auto found = std::find(studies_.begin(), studies_.end(), event.device);
    const auto i = static_cast<std::size_t>(found - studies_.begin());
    if (i < former_.size()) former_[i].push_back({event.time, folder_.last_snapshot()->studies[i]});
  }
  void on_snapshot(const Snapshot& snapshot) noexcept override { folder_.on_snapshot(snapshot); }
  void on_late_sample(const LateSample& late) noexcept override { folder_.on_late_sample(late); }

  [[nodiscard]] const FormerMountings& former_mountings() const { return former_; }

 private:
  RunFolder& folder_;
  std::vector<std::size_t> studies_;
  FormerMountings former_;
};

/// The common low-pass of every S-IMU; none where none is configured.
std::vector<RowLowPass> low_passes(const Configuration& configuration) {
  std::vector<RowLowPass> filters;
  if (configuration.error_process.low_pass_hz <= 0.0) return filters;
  for (const auto index : configuration.study_indices())
    filters.emplace_back(configuration.devices[index].rate_hz, configuration.error_process.low_pass_hz);
  return filters;
}

/// errors_NAME.csv under the names of the regimes, with the scale error; and without it the series for the
/// noise models and the rows for everything that follows.
/// @param of        its row is set here
/// @param studied   takes the rows without the scale error
NoiseSeries write_errors(ErrorRecord of, const RunRegimes& regimes, const ScaleError& scale, RowSpool& rows,
                         RunFolder& folder, RowSpool& studied) {
  NoiseSeries series;
  rows.rewind();
  while (rows.next(of.row)) {
    const auto regime = regimes.chosen.at(of.row.time);
    folder.write_error(of, regime ? std::string_view(regimes.chosen.names()[*regime]) : std::string_view());
    const ErrorRow row = without_scale_error(of.row, scale);
    series.add(row, regime);
    studied.add(row);
  }
  return series;
}

Result<std::vector<RowSpool>> make_spools(std::size_t n, const std::filesystem::path& folder) {
  std::vector<RowSpool> spools;
  for (std::size_t i = 0; i < n; ++i) {
    auto spool = RowSpool::create(folder);
    if (!spool) return tl::unexpected<Error>(spool.error());
    spools.push_back(std::move(*spool));
  }
  return spools;
}

bool calibrated(const StudyOutput& study) {
  return study.status == StudyStatus::kConverging || study.status == StudyStatus::kCalibrated;
}

/// The estimator of the last pass: every mounting that was found is known.
EstimatorConfig frozen(EstimatorConfig config, const std::vector<StudyOutput>& finals) {
  for (std::size_t i = 0; i < config.studies.size(); ++i) {
    const auto& final = finals[i];
    if (!calibrated(final)) continue;
    config.studies[i] = with_mounting(
        config.studies[i], {final.C_b_s, final.r_bs_b_m, final.t_d_s, final.gyro_scale, final.accel_scale});
  }
  return config;
}

nlohmann::json device_json(const RunDescription& run, std::size_t i) {
  const auto& device = run.configuration->devices[i];
  const auto& result = run.result->devices[i];
  const auto& counters = result.counters;
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
                       {"frames_dropped", result.frames_dropped},
                       {"refused", result.refused},
                       {"problem", result.problem},
                       {"clock", run.recording->clocks[i].how},
                       {"clock_shift_s", run.recording->clocks[i].shift_s}};
  const auto studies = run.configuration->study_indices();
  const auto found = std::find(studies.begin(), studies.end(), i);
  const bool is_study = found != studies.end() && run.last != nullptr;
  entry["late"] =
      is_study
          ? nlohmann::json(run.last->studies[static_cast<std::size_t>(found - studies.begin())].counters.late)
          : nlohmann::json(nullptr);
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

std::vector<StudyOutput> final_studies(const Snapshot& last) {
  return {last.studies.begin(), last.studies.begin() + static_cast<std::ptrdiff_t>(last.n_studies)};
}

/// The drive's own mountings, replaced by those that several drives settled.
std::vector<StudyOutput> with_settled(std::vector<StudyOutput> finals,
                                      const std::vector<StudyFileInfo>& infos,
                                      const std::map<std::string, MountingEstimate>& settled) {
  for (std::size_t i = 0; i < finals.size(); ++i) {
    const auto found = settled.find(infos[i].name);
    if (found == settled.end()) continue;
    finals[i].C_b_s = found->second.C_b_s;
    finals[i].r_bs_b_m = found->second.r_bs_b_m;
  }
  return finals;
}

void warn_of_uncalibrated(const Configuration& configuration, const std::vector<StudyOutput>& finals,
                          std::vector<std::string>& warnings) {
  const auto indices = configuration.study_indices();
  for (std::size_t i = 0; i < finals.size(); ++i) {
    if (calibrated(finals[i])) continue;
    warnings.push_back(
        fmt::format("{}: no mounting was found; it needs about a minute of driving with turns, or a "
                    "[device.prior] in the configuration",
                    configuration.devices[indices[i]].name));
  }
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

void warn_of_refused_gnss(const Configuration& configuration, const EstimatorCounters& counters,
                          std::vector<std::string>& warnings) {
  const auto index = configuration.gnss_index();
  if (!index || !contradicts_motion(counters)) return;
  warnings.push_back(fmt::format(
      "{}: {} of {} positions were refused, as they contradict the motion; check whose clock its times are "
      "of "
      "(GPS time is 18 s ahead of UTC), antenna_lever_arm_b_m and the receiver's sd, and do not trust this "
      "run before",
      configuration.devices[*index].name, counters.gnss_positions_rejected,
      counters.gnss_used + counters.gnss_rejected));
}

void warn_of_remounted(const std::vector<StudyFileInfo>& infos, const FormerMountings& former,
                       HostTime first_reference_time, std::vector<std::string>& warnings) {
  for (std::size_t i = 0; i < former.size(); ++i) {
    if (former[i].empty()) continue;
    warnings.push_back(fmt::format(
        "{}: found to sit differently {:.1f} s into the run; calibration.json, its errors and its "
        "noise models are of the mounting after that",
        infos[i].name, to_seconds(former[i].back().until - first_reference_time)));
  }
}

}  // namespace

std::vector<StudyFileInfo> study_file_infos(const Configuration& configuration, const Recording& recording) {
  std::vector<StudyFileInfo> infos;
  for (const auto index : configuration.study_indices()) {
    infos.push_back({configuration.devices[index].name, recording.clocks[index].shift_s});
  }
  return infos;
}

nlohmann::json run_json(const RunDescription& run) {
  nlohmann::json json{{"schema", "imuscope.run/1"},
                      {"name", run.configuration->run_name},
                      {"version", run.version},
                      {"build", fmt::format("{} {}", __VERSION__, sizeof(void*) == 8 ? "64 bit" : "32 bit")},
                      {"configuration", run.configuration->file.filename().string()},
                      {"configuration_sha256", run.configuration->sha256},
                      {"configuration_text", run.configuration->text},
                      {"inputs", run.recording->inputs},
                      {"ticks", run.result->ticks},
                      {"duration_s", static_cast<double>(run.result->ticks) / kTickRate_hz},
                      {"warnings", run.warnings}};
  json["t0_utc"] = run.last != nullptr && run.last->has_utc
                       ? nlohmann::json(utc_text(run.last->first_reference_utc))
                       : nlohmann::json(nullptr);
  if (run.static_s && run.dynamic_s)
    json["regimes"] = {{"static_s", *run.static_s}, {"dynamic_s", *run.dynamic_s}};
  json["devices"] = nlohmann::json::array();
  for (std::size_t i = 0; i < run.configuration->devices.size(); ++i)
    json["devices"].push_back(device_json(run, i));
  if (run.last != nullptr && run.configuration->gnss_index()) json["gnss"] = gnss_json(run.last->counters);
  if (run.last != nullptr && run.last->odometry.enabled) json["odometry"] = odometry_json(*run.last);
  json["events"] = nlohmann::json::array();
  for (const auto& event : run.events) {
    json["events"].push_back(
        {{"time_s", run.last != nullptr ? to_seconds(event.time - run.last->first_reference_time) : 0.0},
         {"text", describe(*run.configuration, event)}});
  }
  return json;
}

Result<void> run_study(const Configuration& configuration, const Recording& recording,
                       const StudyRunOptions& options) {
  const auto spec = noise::parse_model(configuration.noise.model);
  if (!spec) return tl::unexpected<Error>(spec.error());
  auto folder = RunFolder::create(options.out, study_file_infos(configuration, recording), true);
  if (!folder) return tl::unexpected<Error>(folder.error());
  const auto estimator = estimator_config(configuration);

  CalibrationPass first(**folder, configuration);
  ReplayOptions replay_options;
  if (options.progress)
    replay_options.progress = [&](double share) { options.progress("calibration", share); };
  const auto calibrated_run = replay(configuration, estimator, recording, first, replay_options);
  if (!calibrated_run) return tl::unexpected<Error>(calibrated_run.error());
  const Snapshot last = *(*folder)->last_snapshot();
  const auto finals = final_studies(last);

  RunDescription run{options.version, &configuration,      &recording, &*calibrated_run,
                     &last,           (*folder)->events(), {}};
  const auto infos = study_file_infos(configuration, recording);
  const FormerMountings& former = first.former_mountings();
  warn_of_refused_gnss(configuration, last.counters, run.warnings);
  warn_of_uncalibrated(configuration, finals, run.warnings);
  warn_of_remounted(infos, former, last.first_reference_time, run.warnings);
  if (std::none_of(finals.begin(), finals.end(), calibrated)) {
    return work_error(run.warnings.empty() ? "no S-IMU could be calibrated" : run.warnings.front());
  }

  const RecordStorage storage{Smoother::kMemory_bytes, options.out};
  const auto track =
      smooth_drive(configuration, estimator, recording, finals, former, storage, [&](double share) {
        if (options.progress) options.progress("smoothing", share);
      });
  if (!track) return tl::unexpected<Error>(track.error());
  if (auto written = write_smoothed(*track, last, former, infos, options.out); !written) return written;
  const auto means = weighted_means(*track, finals, former);
  if (!means) return tl::unexpected<Error>(means.error());
  const auto biases = ReferenceBiasTrack::of(*track);
  if (!biases) return tl::unexpected<Error>(biases.error());

  const auto settled = with_settled(finals, infos, options.mountings);
  auto rows = make_spools(finals.size(), options.out);
  if (!rows) return tl::unexpected<Error>(rows.error());
  ErrorCollector collector(former, *biases, *rows, low_passes(configuration));
  if (options.progress)
    replay_options.progress = [&](double share) { options.progress("error process", share); };
  const auto second = replay(configuration, frozen(estimator, settled), recording, collector, replay_options);
  if (!second) return tl::unexpected<Error>(second.error());

  const HostTime origin = last.first_reference_time;
  auto regimes =
      find_regimes(configuration.regimes, collector.watch(), options.labels, recording.moments, origin);
  if (!regimes) return tl::unexpected<Error>(regimes.error());
  auto studied = make_spools(finals.size(), options.out);
  if (!studied) return tl::unexpected<Error>(studied.error());
  std::vector<NoiseSeries> series;
  for (std::size_t i = 0; i < finals.size(); ++i) {
    const ScaleError scale = configuration.noise.remove_scale_error
                                 ? ScaleError{settled[i].gyro_scale, settled[i].accel_scale}
                                 : ScaleError{};
    series.push_back(write_errors({i, origin, {}}, *regimes, scale, (*rows)[i], **folder, (*studied)[i]));
  }

  const double run_s = regimes->motion.total_s(0) + regimes->motion.total_s(1);
  for (std::size_t i = 0; i < series.size(); ++i) {
    const auto& device = configuration.devices[configuration.study_indices()[i]];
    const auto remark = coverage_remark(device.name, series[i], device.rate_hz, run_s, origin);
    if (!remark.empty()) regimes->remarks.push_back(remark);
  }

  const auto& names = regimes->chosen.names();
  const auto noise_study = study_noise(configuration, series, names, *spec, [&](double share) {
    if (options.progress) options.progress("noise models", share);
  });
  const auto dependence = study_dependence(configuration, series, collector.temperatures(),
                                           collector.watch().levels(), regimes->motion, noise_study, origin);
  const auto regressions = regressions_of(configuration, *studied, regimes->motion, *spec);
  auto regime_document = regimes_json(*regimes, origin);
  regime_document["left_out"] = noise_study.left_out;
  for (const std::vector<std::string>& remarks :
       {regimes->remarks, noise_study.remarks, dependence.remarks, regressions.remarks})
    run.warnings.insert(run.warnings.end(), remarks.begin(), remarks.end());
  run.static_s = regimes->motion.total_s(0);
  run.dynamic_s = regimes->motion.total_s(1);
  if (auto written = write_scatter(configuration, *studied, origin, options.out); !written) return written;

  if (auto written = (*folder)->write_calibration(*means); !written) return written;
  if (auto closed = (*folder)->close(); !closed) return closed;
  if (auto written = write_models(options.out, models_json(noise_study)); !written) return written;
  const std::pair<const char*, nlohmann::json> documents[] = {
      {"regimes.json", std::move(regime_document)},
      {"comparison.json", comparison_json(noise_study, names)},
      {"dependence.json", dependence.document},
      {"vibration.json", {{"schema", "imuscope.vibration/1"}, {"lines", noise_study.lines}}},
      {"regression.json",
       {{"schema", "imuscope.regression/1"},
        {"regressions", regressions.regressions},
        {"remarks", regressions.remarks}}}};
  for (const auto& [file, document] : documents) {
    if (auto written = write_json(options.out / file, document); !written) return written;
  }
  auto about = run_json(run);
  about["error_process_mounting"] = options.mountings.empty() ? "of this drive" : "of all drives combined";
  return write_json(options.out / "run.json", about);
}

namespace {

/// A replay's results: the files of a run, and the refits of the live run at the same samples.
class ReplaySink final : public CoreSink {
 public:
  ReplaySink(RunFolder& folder, const Configuration& configuration, noise::ModelSpec spec,
             ReplayBroadcast& broadcast)
      : folder_(folder), book_(configuration, std::move(spec)), broadcast_(broadcast) {}

  void on_error(const ErrorRecord& record) noexcept override {
    folder_.on_error(record);
    broadcast_.on_error(record);
    book_.add(record);
    while (const auto refit = book_.refit()) {
      models_.take(*refit);
      broadcast_.on_refit(*refit);
    }
  }
  void on_event(const EstimatorEvent& event) noexcept override { folder_.on_event(event); }
  void on_snapshot(const Snapshot& snapshot) noexcept override {
    folder_.on_snapshot(snapshot);
    broadcast_.on_snapshot(snapshot);
  }
  void on_late_sample(const LateSample& late) noexcept override { folder_.on_late_sample(late); }

  [[nodiscard]] const NewestModels& models() const { return models_; }

 private:
  RunFolder& folder_;
  ModelBook book_;
  ReplayBroadcast& broadcast_;
  NewestModels models_;
};

}  // namespace

Result<void> run_replay(const Configuration& configuration, const Recording& recording,
                        const StudyRunOptions& options, const PlayOptions& play) {
  auto folder = RunFolder::create(options.out, study_file_infos(configuration, recording), true);
  if (!folder) return tl::unexpected<Error>(folder.error());
  // What an earlier study left in this folder would be taken for this run's.
  std::vector<std::string> of_a_study{"models.json",     "regression.json",        "regimes.json",
                                      "dependence.json", "vibration.json",         "comparison.json",
                                      "report.html",     "smoothed_navigation.csv"};
  for (const auto& info : study_file_infos(configuration, recording))
    of_a_study.push_back(fmt::format("smoothed_{}.csv", info.name));
  for (const auto& file : of_a_study) {
    std::error_code absent_is_well;
    std::filesystem::remove(options.out / file, absent_is_well);
  }
  ReplayOptions replay_options;
  replay_options.realtime = play.realtime;
  if (options.progress) replay_options.progress = [&](double share) { options.progress("replay", share); };
  const auto spec = noise::parse_model(configuration.noise.model);
  if (!spec) return tl::unexpected<Error>(spec.error());
  ReplayBroadcast broadcast(configuration, recording, options.version);
  if (!play.lcm_url.empty()) {
    if (auto opened = broadcast.open(play.lcm_url); !opened) return opened;
  }
  ReplaySink sink(**folder, configuration, *spec, broadcast);
  const auto result = replay(configuration, estimator_config(configuration), recording, sink, replay_options);
  if (!result) return tl::unexpected<Error>(result.error());
  if (auto written = sink.models().write(options.out); !written) return written;
  if (auto written = (*folder)->write_calibration(); !written) return written;
  if (auto closed = (*folder)->close(); !closed) return closed;
  const auto& last = (*folder)->last_snapshot();
  RunDescription run{options.version,         &configuration,      &recording, &*result,
                     last ? &*last : nullptr, (*folder)->events(), {}};
  if (last) {
    warn_of_refused_gnss(configuration, last->counters, run.warnings);
    warn_of_uncalibrated(configuration, final_studies(*last), run.warnings);
  }
  return write_json(options.out / "run.json", run_json(run));
}

}  // namespace imuscope
