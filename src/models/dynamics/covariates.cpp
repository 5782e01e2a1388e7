#include "models/dynamics/covariates.h"

namespace imuscope {
namespace {

constexpr std::array<std::string_view, kCovariates> kNames{
    "omega_x",     "omega_y",      "omega_z",      "omega_dot_x",  "omega_dot_y",
    "omega_dot_z", "omega_ddot_x", "omega_ddot_y", "omega_ddot_z", "f_x",
    "f_y",         "f_z",          "f_dot_x",      "f_dot_y",      "f_dot_z"};
constexpr std::array<std::string_view, kCovariateKinds> kUnits{"rad/s", "rad/s^2", "rad/s^3", "m/s^2",
                                                               "m/s^3"};

/// The triad's own prediction and its rate of change.
constexpr Covariate value_kind(std::size_t axis) { return axis < 3 ? Covariate::kOmega : Covariate::kForce; }
constexpr Covariate rate_kind(std::size_t axis) {
  return axis < 3 ? Covariate::kOmegaDot : Covariate::kForceDot;
}

}  // namespace

std::string_view covariate_name(std::size_t index) noexcept { return kNames[index]; }
std::string_view covariate_unit(std::size_t index) noexcept { return kUnits[index / 3]; }

// D-1
std::array<double, kCovariates> covariates(const ErrorRow& row) noexcept {
  std::array<double, kCovariates> all{};
  const std::array<const Vector3*, kCovariateKinds> kinds{&row.predicted_omega_s_radps,
                                                          &row.omega_dot_s_radps2, &row.omega_ddot_s_radps3,
                                                          &row.predicted_f_s_mps2, &row.f_dot_s_mps3};
  for (std::size_t i = 0; i < kCovariates; ++i) all[i] = (*kinds[i / 3])[i % 3];
  return all;
}

std::size_t calibration_column_count(std::size_t axis) noexcept {
  return axis < 3 ? kGyroCalibrationColumns : kAccelCalibrationColumns;
}

void calibration_columns(const ErrorRow& row, std::size_t axis,
                         std::array<double, kAccelCalibrationColumns>& out) noexcept {
  const std::size_t i = axis % 3;
  const Vector3& value = axis < 3 ? row.predicted_omega_s_radps : row.predicted_f_s_mps2;
  const Vector3& rate = axis < 3 ? row.omega_dot_s_radps2 : row.f_dot_s_mps3;
  // D-2, D-3: boresight, scale, time offset
  out[0] = value[(i + 1) % 3];
  out[1] = value[(i + 2) % 3];
  out[2] = value[i];
  out[3] = rate[i];
  if (axis < 3) return;
  // D-3: lever arm; row i of [omega' x] + [omega x]^2, in s axes.
  const Vector3& w = row.predicted_omega_s_radps;
  const Vector3& a = row.omega_dot_s_radps2;
  const std::size_t j = (i + 1) % 3;
  const std::size_t k = (i + 2) % 3;
  out[4 + i] = -(w[j] * w[j] + w[k] * w[k]);
  out[4 + j] = w[i] * w[j] - a[k];
  out[4 + k] = w[i] * w[k] + a[j];
}

bool is_calibration_column(std::size_t axis, std::size_t covariate) noexcept {
  const auto kind = static_cast<Covariate>(covariate / 3);
  if (kind == value_kind(axis)) return true;
  return kind == rate_kind(axis) && covariate % 3 == axis % 3;
}

}  // namespace imuscope
