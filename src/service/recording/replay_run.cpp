#include "service/recording/replay_run.h"

#include <utility>

#include "base/text.h"
#include "service/pipeline/estimator_setup.h"
#include "service/pipeline/live_models.h"
#include "service/recording/replay_broadcast.h"
#include "service/run/modeller.h"
#include "service/run/run_folder.h"
#include "service/run/run_record.h"

namespace imuscope {

namespace {

/// A replay's results: the files of a run, and the refits of the live run at the same samples.
class ReplaySink final : public CoreSink {
 public:
  ReplaySink(RunFolder& folder, const Configuration& configuration, noise::ModelSpec spec,
             ReplayBroadcast& broadcast)
      : folder_(folder),
        live_models_(configuration, std::move(spec),
                     [this](const Refit& refit) {
                       models_.take(refit);
                       broadcast_.on_refit(refit);
                     }),
        broadcast_(broadcast) {}

  void on_error(const ErrorRecord& record) noexcept override {
    folder_.on_error(record);
    broadcast_.on_error(record);
    live_models_.add(record);
  }
  void on_event(const EstimatorEvent& event) noexcept override { folder_.on_event(event); }
  void on_snapshot(const Snapshot& snapshot) noexcept override {
    folder_.on_snapshot(snapshot);
    broadcast_.on_snapshot(snapshot);
  }
  void on_late_sample(const LateSample& late) noexcept override { folder_.on_late_sample(late); }

  /// The recording ends.
  void finish() { live_models_.finish(); }
  [[nodiscard]] const NewestModels& models() const { return models_; }

 private:
  RunFolder& folder_;
  LiveModels live_models_;
  ReplayBroadcast& broadcast_;
  NewestModels models_;
};

}  // namespace

Result<void> run_replay(const Configuration& configuration, const Recording& recording,
                        const ReplayRunOptions& options) {
  auto folder = RunFolder::create(options.out, study_file_infos(configuration, recording), true);
  if (!folder) return tl::unexpected<Error>(folder.error());
  // What an earlier study left in this folder would be taken for this run's.
  std::vector<std::string> of_a_study{"models.json",     "regression.json",        "regimes.json",
                                      "dependence.json", "vibration.json",         "comparison.json",
                                      "report.html",     "smoothed_navigation.csv"};
  for (const auto& info : study_file_infos(configuration, recording))
    of_a_study.push_back(device_file_name("smoothed", info.name, ".csv"));
  for (const auto& file : of_a_study) (*folder)->folder().remove(file);
  ReplayOptions replay_options;
  replay_options.realtime = options.realtime;
  replay_options.reading = Reading::kAhead;
  // Who watches the bus of a paced replay sees each message when its time has come.
  replay_options.has_sink_beside = !options.realtime;
  replay_options.progress = options.progress;
  const auto spec = noise::parse_model(configuration.noise.model);
  if (!spec) return tl::unexpected<Error>(spec.error());
  ReplayBroadcast broadcast(configuration, recording, options.version);
  if (!options.lcm_url.empty()) {
    if (auto opened = broadcast.open(options.lcm_url); !opened) return opened;
  }
  ReplaySink sink(**folder, configuration, *spec, broadcast);
  const auto result = replay(configuration, estimator_config(configuration), recording, sink, replay_options);
  if (!result) return tl::unexpected<Error>(result.error());
  sink.finish();
  broadcast.finish();
  if (auto written = sink.models().write((*folder)->folder()); !written) return written;
  if (auto written = (*folder)->write_calibration(); !written) return written;
  if (auto closed = (*folder)->close(); !closed) return closed;
  const auto& last = (*folder)->last_snapshot();
  auto warnings = warnings_of(recording, *result);
  if (last) {
    const auto of_run = warnings_of(configuration, *last);
    warnings.insert(warnings.end(), of_run.begin(), of_run.end());
  }
  RunRecord run{configuration, options.version,         recording.inputs,    result->devices,
                result->ticks, last ? &*last : nullptr, (*folder)->events(), std::move(warnings)};
  run.utc = &(*folder)->utc();
  return write_run_record((*folder)->folder(), run);
}

}  // namespace imuscope
