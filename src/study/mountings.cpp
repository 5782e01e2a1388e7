#include "study/mountings.h"

#include <cmath>
#include <limits>

#include "base/calibration_levels.h"
#include "base/text.h"
#include "base/units.h"
#include "results/tables/json_fields.h"

namespace imuscope {

namespace {

std::optional<bag::Triads> triads_of(const nlohmann::json& imu) {
  const auto& batch = tables::field(imu, "batch");
  const auto gyro = tables::numbers_at<9>(batch, "gyro_matrix");
  const auto accel = tables::numbers_at<9>(batch, "accel_matrix");
  const auto turn = tables::numbers_at<9>(batch, "C_gyro_accel");
  const auto g_sensitivity = tables::numbers_at<9>(batch, "g_sensitivity_radps_per_mps2");
  if (!gyro || !accel || !turn || !g_sensitivity) return std::nullopt;
  return bag::Triads{*gyro, *accel, *turn, *g_sensitivity};
}

}  // namespace

std::vector<FoundCalibration> found_calibrations(const nlohmann::json& calibration) {
  std::vector<FoundCalibration> found;
  const Vector3 none{};
  for (const auto& imu : tables::field(calibration, "imus")) {
    const std::string name = tables::text_at(imu, "name");
    const auto C_b_s = tables::numbers_at<9>(imu, "C_b_s");
    const auto r_bs_b = tables::numbers_at<3>(imu, "r_bs_b_m");
    const auto t_d = tables::number_at(imu, "t_d_s");
    const std::string status = tables::text_at(imu, "status");
    // A file from elsewhere may call a sensor what no configuration lets it be called.
    constexpr double kOffsetMost_s = 4e9;
    if (!is_device_name(name) || !C_b_s || !r_bs_b || !t_d || !(std::abs(*t_d) < kOffsetMost_s) ||
        !has_estimate(status))
      continue;
    Vector3 sd_boresight = tables::numbers_at<3>(imu, "boresight_sd_deg").value_or(none);
    for (double& sd : sd_boresight) sd *= kRadPerDeg;
    const double sd_t_d =
        tables::number_at(imu, "t_d_sd_s").value_or(std::numeric_limits<double>::quiet_NaN());
    // Two hyphens would end the comment that it is written into.
    const bool is_usable = status == key_of(CalibrationStatus::kCalibrated);
    found.push_back(
        {{name, *C_b_s, *r_bs_b, *t_d, sd_boresight, tables::numbers_at<3>(imu, "r_bs_b_sd_m").value_or(none),
          sd_t_d, is_usable ? "calibrated" : "estimated, not known well enough yet", is_usable},
         {*C_b_s, tables::numbers_at<3>(imu, "gyro_bias_radps").value_or(none),
          tables::numbers_at<3>(imu, "accel_bias_mps2").value_or(none),
          tables::numbers_at<3>(imu, "gyro_scale").value_or(none),
          tables::numbers_at<3>(imu, "accel_scale").value_or(none), *t_d},
         triads_of(imu)});
  }
  return found;
}

}  // namespace imuscope
