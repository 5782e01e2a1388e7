#include "study/several_drives.h"

#include <fmt/format.h>
#include <map>

#include "service/estimator_setup.h"

namespace imuscope {

namespace {

/// Keeps the last snapshot.
class LastSnapshot final : public CoreSink {
 public:
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot& snapshot) noexcept override { last_ = snapshot; }
  void on_late_sample(const LateSample&) noexcept override {}
  [[nodiscard]] const Snapshot& last() const { return last_; }

 private:
  Snapshot last_{};
};

Result<DriveMountings> calibrate(const OpenedRecording& drive, const std::filesystem::path& folder,
                                 const ReplayOptions& options) {
  LastSnapshot sink;
  const auto& configuration = drive.configuration;
  const auto replayed =
      replay(configuration, estimator_config(configuration), drive.recording, sink, options);
  if (!replayed) return tl::unexpected<Error>(replayed.error());
  DriveMountings out;
  out.run = folder;
  out.inputs = drive.recording.inputs;
  const auto indices = configuration.study_indices();
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const StudyOutput& study = sink.last().studies[i];
    const auto& name = configuration.devices[indices[i]].name;
    if (!has_estimate(study.status)) {
      out.without_estimate.push_back(name);
    } else {
      out.studies.push_back({name, {study.C_b_s, study.r_bs_b_m, study.covariance_psi_r}});
    }
  }
  return out;
}

/// What the error processes are made with; drives that differ keep their own mounting.
std::map<std::string, MountingEstimate> settled_mountings(Combination& combination) {
  std::map<std::string, MountingEstimate> settled;
  for (const auto& study : combination.studies) {
    if (study.mounting.homogeneity_p_value >= kOneMountingProbability) {
      settled[study.name] = study.mounting.estimate;
      continue;
    }
    combination.remarks.push_back(
        fmt::format("{}: the drives did not see one mounting (p = {:.2g}); each drive's error process is "
                    "made with its own",
                    study.name, study.mounting.homogeneity_p_value));
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
