#include "study/several_drives.h"

#include <fmt/format.h>
#include <algorithm>
#include <map>

#include "estimation/calibration/events.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/side_by_side.h"
#include "study/batch_study.h"

namespace imuscope {

namespace {

/// Keeps the last snapshot, and where an S-IMU was found to sit differently.
class LastSnapshot final : public CoreSink {
 public:
  explicit LastSnapshot(const Configuration& configuration)
      : studies_(configuration.study_indices()), former_(studies_.size()) {}
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent& event) noexcept override {
    if (!is<event::MountingChanged>(event)) return;
    const auto found = std::find(studies_.begin(), studies_.end(), event.device);
    const auto i = static_cast<std::size_t>(found - studies_.begin());
    if (i < former_.size()) former_[i].push_back({event.time, last_.studies[i]});
  }
  void on_snapshot(const Snapshot& snapshot) noexcept override { last_ = snapshot; }
  void on_late_sample(const LateSample&) noexcept override {}
  [[nodiscard]] std::vector<SImuOutput> studies() const {
    return {last_.studies.begin(), last_.studies.begin() + static_cast<std::ptrdiff_t>(studies_.size())};
  }
  [[nodiscard]] const FormerMountings& former_mountings() const { return former_; }

 private:
  std::vector<std::size_t> studies_;
  FormerMountings former_;
  Snapshot last_{};
};

Result<DriveMountings> calibrate(const OpenedRecording& drive, const std::filesystem::path& folder,
                                 ReplayOptions options) {
  const auto& configuration = drive.configuration;
  LastSnapshot sink(configuration);
  const bool by_batch = configuration.estimator.batch_mounting;
  std::optional<BatchEstimates> batch;
  if (by_batch) {
    batch.emplace(configuration, reader_of(configuration, drive.recording));
    options.on_sample = [&batch](const Sample& sample) { batch->add(sample); };
  }
  const auto replayed =
      replay(configuration, estimator_config(configuration), drive.recording, sink, options);
  if (!replayed) return tl::unexpected<Error>(replayed.error());
  const auto indices = configuration.study_indices();
  std::vector<BatchOutcome> outcomes(indices.size());
  if (by_batch) outcomes = batch->outcomes(sink.former_mountings());
  const auto studies = with_batch(sink.studies(), outcomes);
  DriveMountings out;
  out.run = folder;
  out.inputs = drive.recording.inputs;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const SImuOutput& study = studies[i];
    const auto& name = configuration.devices[indices[i]].name;
    if (outcomes[i].mounting) {
      out.studies.push_back({name, estimate_of(*outcomes[i].mounting)});
    } else if (!has_estimate(study.status)) {
      out.without_estimate.push_back(name);
    } else {
      out.studies.push_back({name, {study.C_b_s, study.r_bs_b_m, study.covariance_psi_r, {}}});
    }
  }
  return out;
}

/// What the error processes are made with; drives that differ keep their own mounting.
std::map<std::string, MountingEstimate> settled_mountings(Combination& combination) {
  std::map<std::string, MountingEstimate> settled;
  for (const auto& study : combination.studies) {
    if (study.mounting.one_mounting_p_value() >= kOneMountingProbability) {
      settled[study.name] = study.mounting.estimate;
      continue;
    }
    combination.remarks.push_back(
        fmt::format("{}: the drives did not see one mounting (p = {:.2g}); each drive's error process is "
                    "made with its own",
                    study.name, study.mounting.one_mounting_p_value()));
  }
  return settled;
}

}  // namespace

std::vector<std::vector<std::string>> drives_of(const std::vector<std::string>& inputs) {
  std::vector<std::vector<std::string>> drives;
  std::map<std::string, std::size_t> seen;
  for (const auto& input : inputs) {
    const auto equals = input.find('=');
    if (equals == std::string::npos) {
      drives.push_back({input});
      continue;
    }
    const std::size_t drive = seen[input.substr(0, equals)]++;
    if (drives.size() <= drive) drives.resize(drive + 1);
    drives[drive].push_back(input);
  }
  return drives;
}

std::filesystem::path drive_folder(const std::filesystem::path& out, std::size_t index) {
  return out / fmt::format("drive{}", index + 1);
}

Result<Combination> run_studies(const std::vector<OpenedRecording>& drives, const StudyRunOptions& options) {
  const auto progress_of = [&options](std::size_t i) {
    return [&options, i](const std::string& step, double share) {
      if (options.progress) options.progress(fmt::format("drive {}: {}", i + 1, step), share);
    };
  };
  std::vector<DriveMountings> mountings;
  for (std::size_t i = 0; i < drives.size(); ++i) {
    ReplayOptions replay_options;
    replay_options.reading = reading_by_threads();
    replay_options.has_sink_beside = may_use_threads();
    replay_options.progress = [progress = progress_of(i)](double share) { progress("calibration", share); };
    auto found = calibrate(drives[i], drive_folder(options.out, i), replay_options);
    if (!found) return tl::unexpected<Error>(found.error());
    mountings.push_back(std::move(*found));
  }
  auto combination = combine_drives(mountings, std::nullopt);
  if (!combination) return combination;
  const auto settled = settled_mountings(*combination);
  for (std::size_t i = 0; i < drives.size(); ++i) {
    StudyRunOptions of_drive = options;
    of_drive.out = drive_folder(options.out, i);
    of_drive.progress = progress_of(i);
    of_drive.mountings = settled;
    of_drive.findings = drives[i].findings;
    if (auto done = run_study(drives[i].configuration, drives[i].recording, of_drive); !done)
      return tl::unexpected<Error>(done.error());
  }
  const auto folder = OutputFolder::open(options.out);
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (auto written = write_json(*folder, "combined.json", combination_json(*combination)); !written)
    return tl::unexpected<Error>(written.error());
  return combination;
}

}  // namespace imuscope
