#include "study/combination.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "base/calibration_levels.h"
#include "base/units.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "results/tables/json_file.h"

namespace imuscope {

namespace {

using nlohmann::json;

Result<json> read_document(const std::filesystem::path& file, const std::string& schema) {
  std::ifstream in(file);
  if (!std::filesystem::is_regular_file(file) || !in) {
    return work_error(fmt::format("{} cannot be read", file.string()),
                      "name folders that `imuscope process`, `run` or `replay` wrote");
  }
  auto document = tables::read_json_file(file);
  if (!document.is_object()) return work_error(fmt::format("{} is not a JSON object", file.string()));
  if (document.value("schema", std::string()) != schema) {
    return work_error(fmt::format("{} is not of schema {}", file.string(), schema),
                      "write it anew with this version of imuscope");
  }
  return document;
}

template <std::size_t N>
bool take_numbers(const json& object, const char* key, std::array<double, N>& out) {
  if (!object.contains(key) || !object[key].is_array() || object[key].size() != N) return false;
  for (std::size_t i = 0; i < N; ++i) {
    if (!object[key][i].is_number()) return false;
    out[i] = object[key][i].template get<double>();
    if (!std::isfinite(out[i])) return false;
  }
  return true;
}

/// Six rows of numbers, one after the other.
bool take_columns(const json& array, std::vector<double>& out) {
  constexpr std::size_t kMaxNumbers = 6 * 1000;
  if (!array.is_array() || array.size() % 6 != 0 || array.size() > kMaxNumbers) return false;
  for (const json& element : array) {
    if (!element.is_number() || !std::isfinite(element.get<double>())) return false;
    out.push_back(element.get<double>());
  }
  return true;
}

/// Name of the field that is missing or malformed; empty when all is well.
std::string take_estimate(const json& imu, MountingEstimate& estimate) {
  if (!take_numbers(imu, "C_b_s", estimate.C_b_s)) return "C_b_s";
  if (!take_numbers(imu, "r_bs_b_m", estimate.r_bs_b_m)) return "r_bs_b_m";
  if (!take_numbers(imu, "covariance_psi_r", estimate.covariance_psi_r)) return "covariance_psi_r";
  if (imu.contains("batch") && imu["batch"].is_object() && imu["batch"].contains("shared_psi_r")) {
    if (!take_columns(imu["batch"]["shared_psi_r"], estimate.shared_psi_r)) return "batch.shared_psi_r";
  }
  const Eigen::Matrix3d C = to_eigen(estimate.C_b_s);
  constexpr double kOrthonormal = 1e-6;
  if (!(C * C.transpose()).isIdentity(kOrthonormal) || C.determinant() < 0.0) return "C_b_s (no rotation)";
  return {};
}

/// Two drives that read a file in common.
bool share_inputs(const DriveMountings& a, const DriveMountings& b) {
  return std::any_of(a.inputs.begin(), a.inputs.end(), [&b](const std::string& input) {
    return std::find(b.inputs.begin(), b.inputs.end(), input) != b.inputs.end();
  });
}

/// Names in the order in which the drives bring them.
std::vector<std::string> study_names(const std::vector<DriveMountings>& drives) {
  std::vector<std::string> names;
  for (const auto& drive : drives) {
    for (const auto& study : drive.studies) {
      if (std::find(names.begin(), names.end(), study.name) == names.end()) names.push_back(study.name);
    }
  }
  return names;
}

json drive_json(const Combination& combination, const CombinedStudy& study, std::size_t i) {
  const DriveDeviation& drive = study.mounting.drives[i];
  std::array<double, 3> psi_deg{};
  std::array<double, 3> psi_sd_deg{};
  std::array<double, 3> r_m{};
  std::array<double, 3> r_sd_m{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    psi_deg[axis] = drive.deviation[axis] * kDegPerRad;
    psi_sd_deg[axis] = drive.deviation_sd[axis] * kDegPerRad;
    r_m[axis] = drive.deviation[axis + 3];
    r_sd_m[axis] = drive.deviation_sd[axis + 3];
  }
  return {{"run", combination.runs[study.drives[i]].string()},
          {"weight", study.mounting.weights[i]},
          {"boresight_from_others_deg", psi_deg},
          {"boresight_from_others_sd_deg", psi_sd_deg},
          {"r_from_others_m", r_m},
          {"r_from_others_sd_m", r_sd_m},
          {"p_value", drive.p_value}};
}

json study_json(const Combination& combination, const CombinedStudy& study) {
  const MountingEstimate& estimate = study.mounting.estimate;
  const Eigen::Quaterniond q = quaternion_from_rotation(to_eigen(estimate.C_b_s));
  std::array<double, 3> psi_sd_deg{};
  std::array<double, 3> r_sd_m{};
  for (std::size_t i = 0; i < 3; ++i) {
    psi_sd_deg[i] = std::sqrt(estimate.covariance_psi_r[7 * i]) * kDegPerRad;
    r_sd_m[i] = std::sqrt(estimate.covariance_psi_r[7 * (i + 3)]);
  }
  json out{{"name", study.name},
           {"C_b_s", estimate.C_b_s},
           {"q_b_s", {q.w(), q.x(), q.y(), q.z()}},
           {"boresight_sd_deg", psi_sd_deg},
           {"r_bs_b_m", estimate.r_bs_b_m},
           {"r_bs_b_sd_m", r_sd_m},
           {"covariance_psi_r", estimate.covariance_psi_r},
           {"homogeneity",
            {{"chi2", study.mounting.homogeneity_chi2},
             {"dof", study.mounting.homogeneity_dof},
             {"p_value", study.mounting.homogeneity_p_value}}},
           {"between_drives",
            {{"boresight_sd_deg", study.mounting.between_drives_psi_sd_rad * kDegPerRad},
             {"r_sd_m", study.mounting.between_drives_r_sd_m}}},
           {"one_mounting_p_value", study.mounting.one_mounting_p_value()},
           {"drives", json::array()}};
  for (std::size_t i = 0; i < study.drives.size(); ++i)
    out["drives"].push_back(drive_json(combination, study, i));
  return out;
}

Result<DriveMountings> mountings_of(const std::filesystem::path& run) {
  const auto file = run / "calibration.json";
  const auto calibration = read_document(file, "imuscope.calibration/1");
  if (!calibration) return tl::unexpected<Error>(calibration.error());
  const auto about = read_document(run / "run.json", "imuscope.run/1");
  if (!about) return tl::unexpected<Error>(about.error());

  DriveMountings out;
  out.run = run;
  if (about->contains("inputs") && (*about)["inputs"].is_array()) {
    for (const auto& input : (*about)["inputs"]) {
      if (input.is_string()) out.inputs.push_back(input);
    }
  }
  if (!calibration->contains("imus") || !(*calibration)["imus"].is_array())
    return work_error(fmt::format("{} has no list \"imus\"", file.string()));
  for (const auto& imu : (*calibration)["imus"]) {
    if (!imu.is_object() || !imu.contains("name") || !imu["name"].is_string())
      return work_error(fmt::format("{}: an entry of \"imus\" has no name", file.string()));
    const std::string name = imu["name"];
    if (!has_estimate(imu.value("status", std::string()))) {
      out.without_estimate.push_back(name);
      continue;
    }
    DriveMountings::Study study{name, {}};
    if (const auto wrong = take_estimate(imu, study.estimate); !wrong.empty()) {
      return work_error(fmt::format("{}: {} of {} is missing or malformed", file.string(), wrong, name),
                        "write it anew with `imuscope process`");
    }
    out.studies.push_back(study);
  }
  return out;
}

}  // namespace

Result<DriveMountings> read_mountings(const std::filesystem::path& run) {
  return tables::with_documents_of(run, [&] { return mountings_of(run); });
}

const char* name_of(CombineMethod method) {
  return method == CombineMethod::kInverseVariance ? "inverse variance" : "covariance intersection";
}

Result<Combination> combine_drives(const std::vector<DriveMountings>& drives,
                                   std::optional<CombineMethod> method) {
  Combination out;
  for (const auto& drive : drives) {
    out.runs.push_back(drive.run);
    for (const auto& name : drive.without_estimate)
      out.remarks.push_back(fmt::format("{} was not calibrated in {}", name, drive.run.string()));
  }
  out.method = method.value_or(CombineMethod::kInverseVariance);
  for (std::size_t i = 0; i < drives.size(); ++i) {
    for (std::size_t j = i + 1; j < drives.size(); ++j) {
      if (!share_inputs(drives[i], drives[j])) continue;
      out.remarks.push_back(fmt::format("{} and {} read the same file: their errors are not independent{}",
                                        drives[i].run.string(), drives[j].run.string(),
                                        method ? "" : ", so covariance intersection is used"));
      if (!method) out.method = CombineMethod::kCovarianceIntersection;
    }
  }
  for (const auto& name : study_names(drives)) {
    CombinedStudy study;
    study.name = name;
    std::vector<MountingEstimate> estimates;
    for (std::size_t i = 0; i < drives.size(); ++i) {
      for (const auto& one : drives[i].studies) {
        if (one.name != name) continue;
        study.drives.push_back(i);
        estimates.push_back(one.estimate);
      }
    }
    if (estimates.size() < 2) {
      out.remarks.push_back(
          fmt::format("{} has a mounting in {} alone", name, drives[study.drives.front()].run.string()));
      continue;
    }
    auto mounting = combine(estimates, out.method);
    if (!mounting)
      return work_error(fmt::format("{}: {}", name, mounting.error().what), mounting.error().remedy);
    study.mounting = std::move(*mounting);
    out.studies.push_back(std::move(study));
  }
  if (out.studies.empty()) {
    return work_error("no S-IMU was calibrated in two of these runs",
                      "the runs must name their devices alike; see calibration.json");
  }
  return out;
}

nlohmann::json combination_json(const Combination& combination) {
  json out{{"schema", "imuscope.combined/1"},
           {"method", name_of(combination.method)},
           {"imus", json::array()},
           {"remarks", combination.remarks}};
  for (const auto& study : combination.studies) out["imus"].push_back(study_json(combination, study));
  return out;
}

}  // namespace imuscope
