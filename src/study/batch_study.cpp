#include "study/batch_study.h"

#include <fmt/format.h>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <future>

#include "base/units.h"
#include "navigation/so3.h"

namespace imuscope {

namespace {

/// More tells no more of constants, and costs memory and time.
constexpr double kLongest_s = 3600.0;
/// Beyond the filter's own coarse search, in case it ended at its border.
constexpr double kSearchMargin_s = 1.0;
/// Chi-square of six degrees of freedom that chance exceeds once in a million times.
constexpr double kContradictionChi2 = 38.3;
/// Scatter over time this much above what the noise explains is worth a sentence.
constexpr double kInconsistencyTold = 2.0;
/// A band that differs from a rigid body by this (half a degree) is worth a sentence.
constexpr double kDeviationTold = 0.01;

using Matrix3Row = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Vector3 vector_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Matrix3 matrix_of(const Eigen::Matrix3d& m) {
  Matrix3 out;
  Eigen::Map<Matrix3Row>(out.data()) = m;
  return out;
}

Vector3 sd_of(const batch::BatchMounting& mounting, batch::Parameter first) {
  return {mounting.sd(first, 0), mounting.sd(first, 1), mounting.sd(first, 2)};
}

/// The part of a record between two instants.
batch::ImuRecord part_of(const batch::ImuRecord& all, double from_s, double to_s) {
  batch::ImuRecord part;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all.time_s[i] < from_s) continue;
    if (all.time_s[i] > to_s) break;
    part.add(all.time_s[i], all.omega_radps[i], all.f_mps2[i]);
  }
  return part;
}

Result<batch::BatchMounting> estimate_part(const batch::ImuRecord& reference, const batch::ImuRecord& study,
                                           double from_s, double to_s) {
  batch::BatchOptions options;
  options.search_s = StudyConfig{}.coarse_search_s + kSearchMargin_s;
  return batch::estimate_mounting(part_of(reference, from_s - options.search_s, to_s + options.search_s),
                                  part_of(study, from_s, to_s), options);
}

/// Whether two estimates cannot be of one mounting.
bool contradict(const batch::BatchMounting& a, const batch::BatchMounting& b) {
  Eigen::Matrix<double, 6, 1> difference;
  difference << -log_so3(a.sensor.C_b_s.transpose() * b.sensor.C_b_s),
      b.sensor.lever_arm_b_m() - a.sensor.lever_arm_b_m();
  const Eigen::Matrix<double, 6, 6> covariance =
      a.covariance.topLeftCorner<6, 6>() + b.covariance.topLeftCorner<6, 6>();
  return difference.dot(covariance.ldlt().solve(difference)) > kContradictionChi2;
}

BatchOutcome estimate_one(const batch::ImuRecord& reference, const batch::ImuRecord& study,
                          std::optional<double> moved_s) {
  BatchOutcome outcome;
  const double first_s = study.size() > 0 ? study.time_s.front() : 0.0;
  auto found = estimate_part(reference, study, first_s, first_s + kLongest_s);
  if (moved_s) {
    const auto before = estimate_part(reference, study, first_s, *moved_s);
    auto after = estimate_part(reference, study, *moved_s, *moved_s + kLongest_s);
    outcome.remounted = before && after && contradict(*before, *after);
    if (outcome.remounted) found = std::move(after);
  }
  if (found) {
    outcome.mounting = std::move(*found);
  } else {
    outcome.why_not = found.error();
  }
  return outcome;
}

std::vector<double> degrees(const Eigen::Vector3d& v) {
  return {v.x() * kDegPerRad, v.y() * kDegPerRad, v.z() * kDegPerRad};
}

nlohmann::json band_json(const batch::BandReport& band) {
  return {{"from_hz", band.from_hz},
          {"to_hz", band.to_hz},
          {"gyro_density_radps_per_sqrt_hz", vector_of(band.gyro_density)},
          {"accel_density_mps2_per_sqrt_hz", vector_of(band.accel_density)},
          {"gyro_deviation_sd", band.gyro_deviation_sd},
          {"accel_deviation_sd", band.accel_deviation_sd}};
}

}  // namespace

BatchRecords::BatchRecords(const Configuration& configuration) : records_(configuration.devices.size()) {
  for (const auto& device : configuration.devices) half_period_s_.push_back(0.5 / device.rate_hz);
}

void BatchRecords::add(const Sample& sample) {
  if (sample.kind != SampleKind::kImu) return;
  constexpr std::uint32_t kBoth = kGyroValid | kAccelValid;
  if ((sample.imu.flags & kBoth) != kBoth) return;
  if (!has_origin_) {
    has_origin_ = true;
    origin_ = sample.time;
  }
  auto& record = records_[sample.device];
  double time_s = to_seconds(sample.time - origin_);
  if ((sample.imu.flags & kIsIncrement) != 0) time_s -= half_period_s_[sample.device];
  if (record.size() > 0 && time_s <= record.time_s.back()) return;
  const Eigen::Vector3f omega =
      Eigen::Map<const Eigen::Vector3d>(sample.imu.omega_radps.data()).cast<float>();
  const Eigen::Vector3f f = Eigen::Map<const Eigen::Vector3d>(sample.imu.f_mps2.data()).cast<float>();
  if (!omega.allFinite() || !f.allFinite()) return;
  record.add(time_s, omega, f);
}

std::vector<BatchOutcome> estimate_mountings(const Configuration& configuration, const BatchRecords& records,
                                             const FormerMountings& former) {
  const auto studies = configuration.study_indices();
  const auto& reference = records.of(configuration.reference_index());
  std::vector<std::future<BatchOutcome>> running;
  for (std::size_t i = 0; i < studies.size(); ++i) {
    std::optional<double> moved_s;
    if (!former[i].empty()) moved_s = to_seconds(former[i].back().until - records.origin());
    const auto& study = records.of(studies[i]);
    running.push_back(std::async(std::launch::async, [&reference, &study, moved_s] {
      return estimate_one(reference, study, moved_s);
    }));
  }
  std::vector<BatchOutcome> outcomes;
  for (auto& one : running) outcomes.push_back(one.get());
  return outcomes;
}

void take_over(const batch::BatchMounting& mounting, StudyOutput& study) {
  const auto& sensor = mounting.sensor;
  const Eigen::Matrix3d C_prior = Eigen::Map<const Matrix3Row>(study.C_prior.data());
  study.C_b_s = matrix_of(sensor.C_b_s);
  study.psi_rad = vector_of(-log_so3(C_prior.transpose() * sensor.C_b_s));
  study.sd_psi_rad = sd_of(mounting, batch::kPsi);
  study.r_bs_b_m = vector_of(sensor.lever_arm_b_m());
  study.sd_r_bs_b_m = sd_of(mounting, batch::kLeverArm);
  study.t_d_s = sensor.x[batch::kTimeOffset];
  study.sd_t_d_s = mounting.sd(batch::kTimeOffset);
  if (!has_estimate(study.status)) {
    study.gyro_bias_radps = vector_of(sensor.x.segment<3>(batch::kGyroBias));
    study.sd_gyro_bias_radps = sd_of(mounting, batch::kGyroBias);
    study.accel_bias_mps2 = vector_of(sensor.x.segment<3>(batch::kAccelBias));
    study.sd_accel_bias_mps2 = sd_of(mounting, batch::kAccelBias);
  }
  study.gyro_scale = vector_of(sensor.x.segment<3>(batch::kGyroShape));
  study.sd_gyro_scale = sd_of(mounting, batch::kGyroShape);
  study.accel_scale = vector_of(sensor.x.segment<3>(batch::kAccelShape));
  study.sd_accel_scale = sd_of(mounting, batch::kAccelShape);
  study.accel_boresight_rad = vector_of(sensor.x.segment<3>(batch::kAlpha));
  study.sd_accel_boresight_rad = sd_of(mounting, batch::kAlpha);
  study.accel_t_d_s = sensor.x[batch::kAccelDelay];
  study.sd_accel_t_d_s = mounting.sd(batch::kAccelDelay);
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(study.covariance_psi_r.data()) =
      mounting.covariance.topLeftCorner<6, 6>();
  study.status = CalibrationStatus::kCalibrated;
  study.observable.fill(true);
  study.t_d_observable = true;
}

nlohmann::json batch_json(const batch::BatchMounting& mounting) {
  const auto& sensor = mounting.sensor;
  nlohmann::json json{
      {"seconds_used", mounting.used_s},
      {"windows", mounting.windows},
      {"iterations", mounting.iterations},
      {"settled", mounting.settled},
      {"rate_correlation", mounting.rate_correlation},
      {"degrees_of_freedom", mounting.degrees_of_freedom},
      {"inconsistency", mounting.inconsistency},
      {"gyro_matrix", matrix_of(sensor.gyro_shape())},
      {"gyro_axes_sd_deg", degrees({mounting.sd(batch::kGyroShape, 3), mounting.sd(batch::kGyroShape, 4),
                                    mounting.sd(batch::kGyroShape, 5)})},
      {"accel_matrix", matrix_of(sensor.accel_shape())},
      {"accel_axes_sd_deg", degrees({mounting.sd(batch::kAccelShape, 3), mounting.sd(batch::kAccelShape, 4),
                                     mounting.sd(batch::kAccelShape, 5)})},
      {"C_gyro_accel", matrix_of(sensor.C_s_accel())},
      {"g_sensitivity_radps_per_mps2", matrix_of(sensor.g_sensitivity())},
      {"flexure_at_5_hz", matrix_of(sensor.flexure())},
      {"accelerometers_in_one_place", mounting.one_chip},
      {"clock_rate", sensor.x[batch::kClockRate]},
      {"clock_rate_sd", mounting.sd(batch::kClockRate)}};
  json["accel_places_s_m"] = nlohmann::json::array();
  for (Eigen::Index i = 0; i < 3; ++i) json["accel_places_s_m"].push_back(vector_of(sensor.place_s_m(i)));
  json["bands"] = nlohmann::json::array();
  for (const auto& band : mounting.bands) json["bands"].push_back(band_json(band));
  return json;
}

nlohmann::json filter_json(const StudyOutput& study, double clock_shift_s) {
  if (!has_estimate(study.status)) return nullptr;
  const auto deg = [](const Vector3& v) {
    return nlohmann::json{v[0] * kDegPerRad, v[1] * kDegPerRad, v[2] * kDegPerRad};
  };
  return {{"C_b_s", study.C_b_s},
          {"boresight_sd_deg", deg(study.sd_psi_rad)},
          {"r_bs_b_m", study.r_bs_b_m},
          {"r_bs_b_sd_m", study.sd_r_bs_b_m},
          {"t_d_s", study.t_d_s + clock_shift_s},
          {"t_d_sd_s", study.sd_t_d_s},
          {"covariance_psi_r", study.covariance_psi_r}};
}

std::string batch_remark(const std::string& name, const batch::BatchMounting& mounting) {
  if (mounting.inconsistency > kInconsistencyTold) {
    return fmt::format(
        "{}: parts of the drive disagree by {:.1f} times what the noise explains; the sd allows for it, but "
        "look whether the sensor sits firmly",
        name, mounting.inconsistency);
  }
  const auto loose =
      std::find_if(mounting.bands.begin(), mounting.bands.end(),
                   [](const batch::BandReport& band) { return band.gyro_deviation_sd > kDeviationTold; });
  if (loose == mounting.bands.end()) return {};
  return fmt::format(
      "{}: above {:.1f} Hz the two IMUs do not move as one rigid body (by {:.1f} % of the rates there); "
      "those "
      "frequencies count less",
      name, loose->from_hz, 100.0 * loose->gyro_deviation_sd);
}

}  // namespace imuscope
