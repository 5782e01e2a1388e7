#include "study/evaluate.h"

#include <fmt/format.h>
#include <fstream>

#include "base/units.h"
#include "results/tables/json_file.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/recording.h"
#include "service/run/run_folder.h"
#include "study/evaluation_drive.h"
#include "study/evaluation_models.h"
#include "study/recording_of_run.h"

namespace imuscope {
namespace {

using nlohmann::json;

Result<json> read_document(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) {
    return work_error(file.string() + " cannot be read",
                      "give the folder that `imuscope process` wrote with --out");
  }
  auto document = tables::read_json_file(file);
  if (document.is_discarded()) return work_error(file.string() + " is no JSON", "make the run again");
  return document;
}

std::array<double, kImuAxes> turn_on_sd(const SImuConfig& study) {
  std::array<double, kImuAxes> sd{};
  for (std::size_t i = 0; i < 3; ++i) {
    sd[i] = study.turn_on_gyro_sd_radps[i];
    sd[i + 3] = study.turn_on_accel_sd_mps2[i];
  }
  return sd;
}

json entry_of(const std::string& name, const CoastingModel& model, const Consistency& c) {
  return {{"name", name},
          {"model", model.name},
          {"source", model.source},
          {"duration_s", c.duration_s},
          {"n", c.n},
          {"n_independent", c.n_independent},
          {"horizontal_rms_m", c.horizontal_rms_m},
          {"horizontal_sd_m", c.horizontal_sd_m},
          {"vertical_rms_m", c.vertical_rms_m},
          {"vertical_sd_m", c.vertical_sd_m},
          {"velocity_rms_mps", c.velocity_rms_mps},
          {"velocity_sd_mps", c.velocity_sd_mps},
          {"attitude_rms_deg", c.attitude_rms_rad * kDegPerRad},
          {"attitude_sd_deg", c.attitude_sd_rad * kDegPerRad},
          {"nees_position", c.nees_position},
          {"nees_velocity", c.nees_velocity},
          {"nees_attitude", c.nees_attitude},
          {"nees_low", c.nees_low},
          {"nees_high", c.nees_high},
          {"surprise", c.surprise}};
}

/// Plays every model of one S-IMU; what there is no model of is named.
void evaluate_study(const StudyDrive& drive, const std::vector<EvaluationModel>& models,
                    const EvaluationRunOptions& options, json& evaluations, json& absent) {
  for (const EvaluationModel& candidate : models) {
    if (!candidate.model) {
      absent.push_back({{"name", drive.name}, {"model", candidate.name}, {"why", candidate.absent_because}});
      continue;
    }
    OutageOptions outages = options.outages;
    if (options.progress) {
      outages.progress = [&](double share) {
        options.progress(fmt::format("{}, {}", drive.name, candidate.name), share);
      };
    }
    const auto results = play_outages(drive.drive, *candidate.model, outages);
    const auto table = consistency_of(results, outages.durations_s);
    for (const Consistency& row : table) evaluations.push_back(entry_of(drive.name, *candidate.model, row));
    if (table.empty()) {
      absent.push_back(
          {{"name", drive.name},
           {"model", candidate.name},
           {"why", fmt::format("no outage fits: it needs {:g} s of driving with GNSS, then {:g} s",
                               outages.settle_s, outages.durations_s.front())}});
    }
  }
}

Result<json> evaluate_documents(const EvaluationRunOptions& options) {
  const auto run = read_document(options.run_dir / "run.json");
  if (!run) return tl::unexpected<Error>(run.error());
  const auto calibration = read_document(options.run_dir / "calibration.json");
  if (!calibration) return tl::unexpected<Error>(calibration.error());
  const auto models = read_document(options.run_dir / "models.json");
  if (!models) return tl::unexpected<Error>(models.error());
  json dependence;
  if (std::filesystem::exists(options.run_dir / "dependence.json")) {
    auto read = read_document(options.run_dir / "dependence.json");
    if (!read) return read;
    dependence = std::move(*read);
  }
  const auto opened =
      open_recording_of_run({options.run_dir, options.inputs, options.configuration}, *run, options.progress);
  if (!opened) return tl::unexpected<Error>(opened.error());
  const auto drives = evaluation_drives(*opened, options.run_dir, *calibration, [&](double share) {
    if (options.progress) options.progress("reading the drive", share);
  });
  if (!drives) return tl::unexpected<Error>(drives.error());

  json evaluations = json::array();
  json absent = json::array();
  const auto estimator = estimator_config(opened->configuration);
  const auto indices = opened->configuration.study_indices();
  for (const StudyDrive& drive : *drives) {
    for (std::size_t i = 0; i < indices.size(); ++i) {
      const DeviceConfig& device = opened->configuration.devices[indices[i]];
      if (device.name != drive.name) continue;
      const auto candidates =
          evaluation_models(drive, device.data_sheet, turn_on_sd(estimator.studies[i]), *models, dependence);
      evaluate_study(drive, candidates, options, evaluations, absent);
    }
  }
  if (evaluations.empty()) {
    return work_error(
        absent.empty() ? "no S-IMU of this run was calibrated" : absent.front().at("why").get<std::string>(),
        "a longer drive, or a shorter --settle");
  }
  json document{{"schema", "imuscope.evaluation/1"},    {"durations_s", options.outages.durations_s},
                {"settle_s", options.outages.settle_s}, {"spacing_s", options.outages.spacing_s},
                {"evaluations", evaluations},           {"absent", absent}};
  const auto folder = OutputFolder::open(options.run_dir);
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (auto written = write_json(*folder, "evaluation.json", document); !written)
    return tl::unexpected<Error>(written.error());
  return document;
}

}  // namespace

Result<json> evaluate_run(const EvaluationRunOptions& options) {
  return tables::with_documents_of(options.run_dir, [&] { return evaluate_documents(options); });
}

}  // namespace imuscope
