#include "service/study.h"

#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/units.h"
#include "noise/fit.h"
#include "noise/json.h"
#include "noise/wavelet_variance.h"
#include "service/dynamics_files.h"
#include "service/estimator_setup.h"
#include "service/modeller.h"
#include "service/noise_series.h"
#include "service/report_values.h"
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
  /// @param rows  one spool a S-IMU; must outlive the collector, as must `biases`
  ErrorCollector(std::vector<StudyOutput> finals, const ReferenceBiasTrack& biases, bool remove_scale,
                 RunFolder& folder, std::vector<RowSpool>& rows)
      : finals_(std::move(finals)),
        biases_(biases),
        remove_scale_(remove_scale),
        folder_(folder),
        rows_(rows),
        series_(finals_.size()) {}

  void on_epoch(const StudyEpoch& epoch, HostTime first_reference_time) noexcept override {
    const HostTime shown = epoch.time + from_seconds(epoch.t_d_s);
    on_error({epoch.study, first_reference_time,
              error_row(epoch, {epoch.C_b_s, epoch.r_bs_b_m}, biases_.at(shown))});
  }
  void on_error(const ErrorRecord& record) noexcept override {
    folder_.on_error(record);
    const auto& final = finals_[record.study];
    const ErrorRow row =
        remove_scale_ ? without_scale_error(record.row, {final.gyro_scale, final.accel_scale}) : record.row;
    series_[record.study].add(row);
    rows_[record.study].add(row);
  }
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot&) noexcept override {}
  void on_late_sample(const LateSample&) noexcept override {}

  [[nodiscard]] const std::vector<NoiseSeries>& series() const { return series_; }

 private:
  std::vector<StudyOutput> finals_;
  const ReferenceBiasTrack& biases_;
  bool remove_scale_;
  RunFolder& folder_;
  std::vector<RowSpool>& rows_;
  std::vector<NoiseSeries> series_;
};

/// First pass: everything but errors goes to the folder.
class CalibrationPass final : public CoreSink {
 public:
  explicit CalibrationPass(RunFolder& folder) : folder_(folder) {}
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent& event) noexcept override { folder_.on_event(event); }
  void on_snapshot(const Snapshot& snapshot) noexcept override { folder_.on_snapshot(snapshot); }
  void on_late_sample(const LateSample& late) noexcept override { folder_.on_late_sample(late); }

 private:
  RunFolder& folder_;
};

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

/// Fits one axis in one regime; what cannot be fitted becomes a warning.
void fit_axis(const NoiseSeries& series, std::size_t axis, const std::vector<std::uint8_t>& mask,
              const std::string& regime, const std::string& name, double rate_hz,
              const noise::ModelSpec& spec, nlohmann::json& models, std::vector<std::string>& warnings) {
  noise::WvOptions options;
  options.mask = mask;
  const auto wv = noise::haar_wavelet_variance(series.values(axis), options);
  if (!wv) {
    warnings.push_back(
        fmt::format("{} {} {}: no wavelet variance: {}", name, axis_name(axis), regime, wv.error().what));
    return;
  }
  noise::FitOptions fit_options;
  fit_options.signal_unit = axis_unit(axis);
  const auto fit = noise::fit(*wv, spec, rate_hz, fit_options);
  if (!fit) {
    warnings.push_back(
        fmt::format("{} {} {}: no noise model: {}", name, axis_name(axis), regime, fit.error().what));
    return;
  }
  models.push_back(model_json(*fit, name, axis, regime));
}

nlohmann::json fit_models(const Configuration& configuration, const std::vector<NoiseSeries>& all_series,
                          const noise::ModelSpec& spec, const StudyRunOptions& options,
                          std::vector<std::string>& warnings) {
  nlohmann::json models = nlohmann::json::array();
  const auto indices = configuration.study_indices();
  const double total = static_cast<double>(all_series.size() * kAxisCount);
  double done = 0.0;
  for (std::size_t i = 0; i < all_series.size(); ++i) {
    const auto& series = all_series[i];
    const auto& device = configuration.devices[indices[i]];
    for (std::size_t axis = 0; axis < kAxisCount && series.size() > 0; ++axis) {
      fit_axis(series, axis, series.mask(axis), "all", device.name, device.rate_hz, spec, models, warnings);
      for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {
        fit_axis(series, axis, series.mask(axis, regime), regime_name(regime), device.name, device.rate_hz,
                 spec, models, warnings);
      }
      if (options.progress) options.progress("noise models", (done += 1.0) / total);
    }
  }
  return models;
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
                      {"regimes", {{"static_s", run.static_s}, {"dynamic_s", run.dynamic_s}}},
                      {"warnings", run.warnings}};
  json["t0_utc"] = run.last != nullptr && run.last->has_utc
                       ? nlohmann::json(utc_text(run.last->first_reference_utc))
                       : nlohmann::json(nullptr);
  json["devices"] = nlohmann::json::array();
  for (std::size_t i = 0; i < run.configuration->devices.size(); ++i)
    json["devices"].push_back(device_json(run, i));
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

  CalibrationPass first(**folder);
  ReplayOptions replay_options;
  if (options.progress)
    replay_options.progress = [&](double share) { options.progress("calibration", share); };
  const auto calibrated_run = replay(configuration, estimator, recording, first, replay_options);
  if (!calibrated_run) return tl::unexpected<Error>(calibrated_run.error());
  const Snapshot last = *(*folder)->last_snapshot();
  const auto finals = final_studies(last);

  RunDescription run{options.version, &configuration,      &recording, &*calibrated_run,
                     &last,           (*folder)->events(), {}};
  warn_of_uncalibrated(configuration, finals, run.warnings);
  if (std::none_of(finals.begin(), finals.end(), calibrated)) {
    return work_error(run.warnings.empty() ? "no S-IMU could be calibrated" : run.warnings.front());
  }

  const RecordStorage storage{Smoother::kMemory_bytes, options.out};
  const auto track = smooth_drive(configuration, estimator, recording, finals, storage, [&](double share) {
    if (options.progress) options.progress("smoothing", share);
  });
  if (!track) return tl::unexpected<Error>(track.error());
  const auto infos = study_file_infos(configuration, recording);
  if (auto written = write_smoothed(*track, last, infos, options.out); !written) return written;
  const auto means = weighted_means(*track, finals);
  if (!means) return tl::unexpected<Error>(means.error());
  const auto biases = ReferenceBiasTrack::of(*track);
  if (!biases) return tl::unexpected<Error>(biases.error());

  const auto settled = with_settled(finals, infos, options.mountings);
  std::vector<RowSpool> rows;
  for (std::size_t i = 0; i < finals.size(); ++i) {
    auto spool = RowSpool::create(options.out);
    if (!spool) return tl::unexpected<Error>(spool.error());
    rows.push_back(std::move(*spool));
  }
  ErrorCollector collector(settled, *biases, configuration.noise.remove_scale_error, **folder, rows);
  if (options.progress)
    replay_options.progress = [&](double share) { options.progress("error process", share); };
  const auto second = replay(configuration, frozen(estimator, settled), recording, collector, replay_options);
  if (!second) return tl::unexpected<Error>(second.error());

  const auto models = fit_models(configuration, collector.series(), *spec, options, run.warnings);
  const auto regressions = regressions_of(configuration, rows, *spec, run.warnings);
  if (auto written = write_scatter(configuration, rows, last.first_reference_time, options.out); !written) {
    return written;
  }
  const auto& series = collector.series();
  const double rate_hz = configuration.devices[configuration.study_indices().front()].rate_hz;
  run.static_s = static_cast<double>(series.front().count(Regime::kStatic)) / rate_hz;
  run.dynamic_s = static_cast<double>(series.front().count(Regime::kDynamic)) / rate_hz;

  if (auto written = (*folder)->write_calibration(*means); !written) return written;
  if (auto closed = (*folder)->close(); !closed) return closed;
  if (auto written = write_models(options.out, models); !written) {
    return written;
  }
  if (auto written = write_json(options.out / "regression.json",
                                {{"schema", "imuscope.regression/1"}, {"regressions", regressions}});
      !written) {
    return written;
  }
  auto about = run_json(run);
  about["error_process_mounting"] = options.mountings.empty() ? "of this drive" : "of all drives combined";
  return write_json(options.out / "run.json", about);
}

namespace {

/// A replay's results: the files of a run, and the refits of the live run at the same samples.
class ReplaySink final : public CoreSink {
 public:
  ReplaySink(RunFolder& folder, const Configuration& configuration, noise::ModelSpec spec)
      : folder_(folder), book_(configuration, std::move(spec)) {}

  void on_error(const ErrorRecord& record) noexcept override {
    folder_.on_error(record);
    book_.add(record);
    while (const auto refit = book_.refit()) models_.take(*refit);
  }
  void on_event(const EstimatorEvent& event) noexcept override { folder_.on_event(event); }
  void on_snapshot(const Snapshot& snapshot) noexcept override { folder_.on_snapshot(snapshot); }
  void on_late_sample(const LateSample& late) noexcept override { folder_.on_late_sample(late); }

  [[nodiscard]] const NewestModels& models() const { return models_; }

 private:
  RunFolder& folder_;
  ModelBook book_;
  NewestModels models_;
};

}  // namespace

Result<void> run_replay(const Configuration& configuration, const Recording& recording,
                        const StudyRunOptions& options, bool realtime) {
  auto folder = RunFolder::create(options.out, study_file_infos(configuration, recording), true);
  if (!folder) return tl::unexpected<Error>(folder.error());
  // What an earlier study left in this folder would be taken for this run's.
  std::vector<std::string> of_a_study{"models.json", "regression.json", "report.html",
                                      "smoothed_navigation.csv"};
  for (const auto& info : study_file_infos(configuration, recording))
    of_a_study.push_back(fmt::format("smoothed_{}.csv", info.name));
  for (const auto& file : of_a_study) {
    std::error_code absent_is_well;
    std::filesystem::remove(options.out / file, absent_is_well);
  }
  ReplayOptions replay_options;
  replay_options.realtime = realtime;
  if (options.progress) replay_options.progress = [&](double share) { options.progress("replay", share); };
  const auto spec = noise::parse_model(configuration.noise.model);
  if (!spec) return tl::unexpected<Error>(spec.error());
  ReplaySink sink(**folder, configuration, *spec);
  const auto result = replay(configuration, estimator_config(configuration), recording, sink, replay_options);
  if (!result) return tl::unexpected<Error>(result.error());
  if (auto written = sink.models().write(options.out); !written) return written;
  if (auto written = (*folder)->write_calibration(); !written) return written;
  if (auto closed = (*folder)->close(); !closed) return closed;
  const auto& last = (*folder)->last_snapshot();
  RunDescription run{options.version,         &configuration,      &recording, &*result,
                     last ? &*last : nullptr, (*folder)->events(), {}};
  if (last) warn_of_uncalibrated(configuration, final_studies(*last), run.warnings);
  return write_json(options.out / "run.json", run_json(run));
}

}  // namespace imuscope
