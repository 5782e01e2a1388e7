#include "study/study.h"

#include <fmt/format.h>
#include <malloc.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "service/pipeline/estimator_setup.h"
#include "service/recording/side_by_side.h"
#include "service/run/models_file.h"
#include "service/run/run_folder.h"
#include "service/run/run_record.h"
#include "study/batch_study.h"
#include "study/dependence_study.h"
#include "study/dynamics_files.h"
#include "study/ends_beside.h"
#include "study/error_files.h"
#include "study/error_pass.h"
#include "study/mounted_passes.h"
#include "study/noise_study.h"
#include "study/regime_study.h"
#include "study/smoothing.h"

namespace imuscope {

namespace {

/// First pass: everything but errors goes to the folder.
class CalibrationPass final : public CoreSink {
 public:
  CalibrationPass(RunFolder& folder, const Configuration& configuration)
      : folder_(folder), studies_(configuration.study_indices()), former_(studies_.size()) {}
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent& event) noexcept override {
    folder_.on_event(event);
    if (!is<event::MountingChanged>(event) || !folder_.last_snapshot()) return;
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

Result<std::vector<RowSpool>> make_spools(std::size_t n, const OutputFolder& folder) {
  std::vector<RowSpool> spools;
  for (std::size_t i = 0; i < n; ++i) {
    auto spool = RowSpool::create(folder);
    if (!spool) return tl::unexpected<Error>(spool.error());
    spools.push_back(std::move(*spool));
  }
  return spools;
}

std::vector<SImuOutput> final_studies(const Snapshot& last) {
  return {last.studies.begin(), last.studies.begin() + static_cast<std::ptrdiff_t>(last.n_studies)};
}

/// What is taken out of each S-IMU's error before it is studied; nothing where that is not configured.
std::vector<ScaleError> scale_errors(const Configuration& configuration,
                                     const std::vector<SImuOutput>& settled) {
  std::vector<ScaleError> scales(settled.size());
  for (std::size_t i = 0; configuration.noise.remove_scale_error && i < scales.size(); ++i)
    scales[i] = {settled[i].gyro_scale, settled[i].accel_scale};
  return scales;
}

/// What is taken from the smoothed drive.
struct SmoothedDrive {
  std::vector<nlohmann::json> means;  ///< weighted, of each S-IMU's mounting
  ReferenceBiasTrack biases;
};

Result<SmoothedDrive> smoothed_drive(const SmoothedTrack& track, const std::vector<SImuOutput>& finals,
                                     const FormerMountings& former) {
  auto means = weighted_means(track, finals, former);
  if (!means) return tl::unexpected<Error>(means.error());
  auto biases = ReferenceBiasTrack::of(track);
  if (!biases) return tl::unexpected<Error>(biases.error());
  return SmoothedDrive{std::move(*means), std::move(*biases)};
}

/// The drive's own mountings, replaced by those that several drives settled.
std::vector<SImuOutput> with_settled(std::vector<SImuOutput> finals, const std::vector<SImuFileInfo>& infos,
                                     const std::map<std::string, MountingEstimate>& settled) {
  for (std::size_t i = 0; i < finals.size(); ++i) {
    const auto found = settled.find(infos[i].name);
    if (found == settled.end()) continue;
    finals[i].C_b_s = found->second.C_b_s;
    finals[i].r_bs_b_m = found->second.r_bs_b_m;
  }
  return finals;
}

/// Former mountings that the batch confirms: a filter that is told too little noise finds changes where there
/// are none.
FormerMountings confirmed(FormerMountings former, const std::vector<BatchOutcome>& outcomes) {
  for (std::size_t i = 0; i < former.size(); ++i) {
    if (outcomes[i].mounting && !outcomes[i].remounted) former[i].clear();
  }
  return former;
}

/// What the batch has to say, refusals first.
std::vector<std::string> remarks_of_batch(const std::vector<SImuFileInfo>& infos,
                                          const std::vector<SImuOutput>& of_filter,
                                          const std::vector<BatchOutcome>& outcomes) {
  std::vector<std::string> refusals;
  std::vector<std::string> remarks;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const auto& outcome = outcomes[i];
    if (outcome.mounting) {
      if (auto remark = batch_remark(infos[i].name, *outcome.mounting); !remark.empty())
        remarks.push_back(std::move(remark));
    } else if (has_estimate(of_filter[i].status) && outcome.why_not.kind == ErrorKind::kWork) {
      remarks.push_back(fmt::format("{}: its mounting is the filter's, as the batch estimate found none: {}",
                                    infos[i].name, outcome.why_not.text()));
    } else {
      refusals.push_back(fmt::format("{}: no mounting was found: {}", infos[i].name, outcome.why_not.text()));
    }
  }
  refusals.insert(refusals.end(), remarks.begin(), remarks.end());
  return refusals;
}

/// What calibration.json says of each S-IMU beside the published values.
std::vector<CalibrationEntry> calibration_entries(const std::vector<SImuOutput>& finals,
                                                  const std::vector<SImuOutput>& of_filter,
                                                  const std::vector<BatchOutcome>& outcomes,
                                                  const std::vector<SImuFileInfo>& infos,
                                                  const std::vector<nlohmann::json>& weighted_means) {
  std::vector<CalibrationEntry> entries;
  for (std::size_t i = 0; i < finals.size(); ++i) {
    CalibrationEntry entry{finals[i], {{"weighted_mean", weighted_means[i]}}};
    if (outcomes[i].mounting) {
      entry.more["method"] = "batch estimate";
      entry.more["batch"] = batch_json(*outcomes[i].mounting);
      entry.more["observability"] = batch_observability_json(finals[i], *outcomes[i].mounting);
      entry.more["filter"] = filter_json(of_filter[i], infos[i].clock_shift_s);
    }
    entries.push_back(std::move(entry));
  }
  return entries;
}

void warn_of_remounted(const std::vector<SImuFileInfo>& infos, const FormerMountings& former,
                       HostTime first_reference_time, std::vector<std::string>& warnings) {
  for (std::size_t i = 0; i < former.size(); ++i) {
    if (former[i].empty()) continue;
    warnings.push_back(fmt::format(
        "{}: found to sit differently {:.1f} s into the run; calibration.json, its errors and its "
        "noise models are of the mounting after that",
        infos[i].name, to_seconds(former[i].back().until - first_reference_time)));
  }
}

tl::unexpected<Error> nothing_was_run(const ReplayResult& result) {
  return work_error(
      fmt::format(
          "the estimator never came to a result: {} ticks were run, and a result comes with every {}th",
          result.ticks, kTicksPerSnapshot),
      "a recording whose own record says that every tick was skipped, or that ends at once, is damaged or "
      "forged");
}

/// Work beside the caller's. It has ended when this is gone.
class Beside {
 public:
  template <typename Work>
  explicit Beside(Work work) {
    group_.run(std::move(work));
  }
  ~Beside() { group_.wait(); }
  Beside(const Beside&) = delete;
  Beside& operator=(const Beside&) = delete;
  void wait() { group_.wait(); }

 private:
  tbb::task_group group_;
};

}  // namespace

Result<void> run_study(const Configuration& configuration, const Recording& recording,
                       const StudyRunOptions& options) {
  const auto spec = noise::parse_model(configuration.noise.model);
  if (!spec) return tl::unexpected<Error>(spec.error());
  auto folder = RunFolder::create(options.out, study_file_infos(configuration, recording), true);
  if (!folder) return tl::unexpected<Error>(folder.error());
  const auto estimator = estimator_config(configuration);

  CalibrationPass first(**folder, configuration);
  ReplayOptions replay_options;
  replay_options.reading = reading_by_threads();
  replay_options.has_sink_beside = may_use_threads();
  if (options.progress)
    replay_options.progress = [&](double share) { options.progress("calibration", share); };
  const auto infos = study_file_infos(configuration, recording);
  const MountedPasses::Drive drive{configuration, estimator, recording, (*folder)->folder(), options.out};
  // What the batch and the passes are told before the whole of it is there is what they are told in the end, or
  // not used.
  std::unique_ptr<MountedPasses> passes;
  const auto begin_ahead = [&](const std::vector<BatchOutcome>& foreseen) {
    const auto mountings = with_batch(std::vector<SImuOutput>(foreseen.size()), foreseen);
    auto begun = MountedPasses::begin(
        drive,
        {mountings, with_settled(mountings, infos, options.mountings), FormerMountings(foreseen.size())},
        true);
    if (begun) passes = std::move(*begun);
  };
  EndsBeside ends;
  std::optional<BatchEstimates> batch;
  const bool by_batch = configuration.estimator.batch_mounting;
  if (by_batch) {
    batch.emplace(configuration, reader_of(configuration, recording),
                  may_use_threads() ? BatchEstimates::Foreseen(begin_ahead) : nullptr,
                  options.batch_longest_s.value_or(kBatchLongest_s));
    replay_options.on_sample = [&batch](const Sample& sample) { batch->add(sample); };
  }
  const auto calibrated_run = replay(configuration, estimator, recording, first, replay_options);
  if (!calibrated_run) return tl::unexpected<Error>(calibrated_run.error());
  if (!(*folder)->last_snapshot()) return nothing_was_run(*calibrated_run);
  Snapshot last = *(*folder)->last_snapshot();
  const auto of_filter = final_studies(last);
  if (by_batch && options.progress) options.progress("batch estimate", 0.0);
  std::vector<BatchOutcome> outcomes(of_filter.size());
  if (by_batch) outcomes = batch->outcomes(first.former_mountings());
  batch.reset();
  const auto finals = by_batch ? with_batch(of_filter, outcomes) : of_filter;
  std::copy(finals.begin(), finals.end(), last.studies.begin());

  RunRecord run{configuration,         options.version, recording.inputs,    calibrated_run->devices,
                calibrated_run->ticks, &last,           (*folder)->events(), {}};
  run.utc = &(*folder)->utc();
  run.findings = options.findings;
  if (by_batch) run.warnings = remarks_of_batch(infos, of_filter, outcomes);
  for (const auto& warnings : {warnings_of(recording, *calibrated_run), warnings_of(configuration, last)})
    run.warnings.insert(run.warnings.end(), warnings.begin(), warnings.end());
  const FormerMountings former = confirmed(first.former_mountings(), outcomes);
  warn_of_remounted(infos, former, last.first_reference_time, run.warnings);
  if (std::none_of(finals.begin(), finals.end(),
                   [](const SImuOutput& final) { return has_estimate(final.status); })) {
    return work_error(run.warnings.empty() ? "no S-IMU could be calibrated" : run.warnings.front());
  }

  const StudyMountings mountings{finals, with_settled(finals, infos, options.mountings), former};
  if (!passes || !passes->are_of(mountings)) {
    passes.reset();
    auto begun = MountedPasses::begin(drive, mountings, false);
    if (!begun) return tl::unexpected<Error>(begun.error());
    passes = std::move(*begun);
  }
  auto passed = passes->result([&](double share) {
    if (options.progress) options.progress("smoothing", share);
  });
  passes.reset();
  if (!passed) return tl::unexpected<Error>(passed.error());
  std::optional<SmoothedTrack> track(std::move(passed->track));
  EpochGatherer& epochs = passed->epochs;
  ends.end(std::move(passed->history));
  // Nothing below needs the smoothed drive's files.
  Result<void> smoothed_files;
  Beside writer([&] {
    smoothed_files = write_smoothed(*track, last, (*folder)->utc(), former, infos, (*folder)->folder());
  });
  const auto smoothed = smoothed_drive(*track, finals, former);
  if (!smoothed) return tl::unexpected<Error>(smoothed.error());
  if (options.progress) options.progress("error process", 0.0);
  auto rows = make_spools(finals.size(), (*folder)->folder());
  if (!rows) return tl::unexpected<Error>(rows.error());
  if (auto made = epochs.make_rows(configuration, former, smoothed->biases, *rows); !made) return made;
  ends.end(epochs.take_kept());

  const HostTime origin = last.first_reference_time;
  const UtcTrack& utc = (*folder)->utc();
  const auto labels = labels_of_run(options.labels, origin, [&](UtcTime time) { return utc.time_of(time); });
  if (!labels) return tl::unexpected<Error>(labels.error());
  auto regimes = find_regimes(configuration.regimes, epochs.watch(), *labels, recording.moments, origin);
  if (!regimes) return tl::unexpected<Error>(regimes.error());
  auto studied_rows = make_spools(finals.size(), (*folder)->folder());
  if (!studied_rows) return tl::unexpected<Error>(studied_rows.error());
  StudiedRows studied{std::move(*studied_rows), {}};
  const std::vector<NoiseSeries>& series = studied.series;
  write_errors(origin, *regimes, scale_errors(configuration, mountings.settled), *rows, **folder, studied);
  ends.end(std::move(*rows));

  writer.wait();
  ends.end(std::move(*track));
  track.reset();
  // Calibration and smoothing leave a heap full of small holes; what the noise models need are long pieces.
  malloc_trim(0);
  if (!smoothed_files) return smoothed_files;

  const double run_s = regimes->motion.total_s(0) + regimes->motion.total_s(1);
  for (std::size_t i = 0; i < series.size(); ++i) {
    const auto& device = configuration.devices[configuration.study_indices()[i]];
    const auto remark = coverage_remark(device.name, series[i], device.rate_hz, run_s, origin);
    if (!remark.empty()) regimes->remarks.push_back(remark);
  }

  const auto& names = regimes->chosen.names();
  // The regressions need no noise model of the error process, and each of them takes longer than one.
  Regressions regressions_of_run(configuration, studied.rows, regimes->motion, *spec);
  const auto noise_study = study_noise(
      configuration, series, names, *spec,
      [&](double share) {
        if (options.progress) options.progress("noise models", share);
      },
      regressions_of_run.jobs());
  const DynamicsRegressions regressions = std::move(regressions_of_run).result();
  DependenceStudy dependence;
  nlohmann::json models;
  nlohmann::json comparison;
  Result<void> scatter;
  tbb::parallel_invoke(
      [&] {
        dependence = study_dependence(configuration, series, epochs.temperatures(), epochs.watch().levels(),
                                      regimes->motion, noise_study, origin);
      },
      [&] { models = models_json(noise_study); }, [&] { comparison = comparison_json(noise_study, names); },
      [&] {
        scatter = write_scatter(configuration, studied.rows, origin, (*folder)->folder());
        ends.end(std::move(studied.rows));
      });
  if (!scatter) return scatter;
  auto regime_document = regimes_json(*regimes, origin);
  regime_document["left_out"] = noise_study.left_out;
  run.warnings.insert(run.warnings.end(), regimes->remarks.begin(), regimes->remarks.end());
  for (const std::vector<std::string>& remarks :
       {noise_study.remarks, dependence.remarks, regressions.remarks})
    run.notes.insert(run.notes.end(), remarks.begin(), remarks.end());
  run.static_s = regimes->motion.total_s(0);
  run.dynamic_s = regimes->motion.total_s(1);
  if (auto written = (*folder)->write_calibration(
          calibration_entries(finals, of_filter, outcomes, infos, smoothed->means));
      !written)
    return written;
  if (auto closed = (*folder)->close(); !closed) return closed;
  if (auto written = write_models((*folder)->folder(), models); !written) return written;
  const std::pair<const char*, nlohmann::json> documents[] = {
      {"regimes.json", std::move(regime_document)},
      {"comparison.json", std::move(comparison)},
      {"dependence.json", dependence.document},
      {"vibration.json", {{"schema", "imuscope.vibration/1"}, {"lines", noise_study.lines}}},
      {"regression.json",
       {{"schema", "imuscope.regression/1"},
        {"regressions", regressions.regressions},
        {"remarks", regressions.remarks}}}};
  for (const auto& [file, document] : documents) {
    if (auto written = write_json((*folder)->folder(), file, document); !written) return written;
  }
  run.error_process_mounting = options.mountings.empty() ? "of this drive" : "of all drives combined";
  return write_run_record((*folder)->folder(), run);
}

}  // namespace imuscope
