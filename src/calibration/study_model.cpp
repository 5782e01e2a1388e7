#include "calibration/study_model.h"

#include <cmath>

#include "navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

void append(SparseMeasurement& H, std::size_t column, const Matrix3d& block) noexcept {
  if (column == StudyLayout::kAbsent) return;
  MeasurementBlock& out = H.append(column, 3);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      out.h[i][j] = block(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }
}

void append(SparseMeasurement& H, std::size_t column, const Vector3d& block) noexcept {
  if (column == StudyLayout::kAbsent) return;
  MeasurementBlock& out = H.append(column, 1);
  for (std::size_t i = 0; i < 3; ++i) out.h[i][0] = block(static_cast<Eigen::Index>(i));
}

Vector3d error_at(std::span<const double> error, std::size_t first) noexcept {
  return {error[first], error[first + 1], error[first + 2]};
}

}  // namespace

StudyLayout StudyLayout::make(std::uint32_t blocks, std::size_t first) noexcept {
  StudyLayout layout;
  layout.first = first;
  std::size_t next = first;
  const auto place = [&](StudyBlock block, std::size_t width) {
    if ((blocks & block) == 0) return kAbsent;
    const std::size_t column = next;
    next += width;
    return column;
  };
  layout.psi = place(kBoresightBlock, 3);
  layout.r = place(kLeverArmBlock, 3);
  layout.gyro_bias = place(kGyroBiasBlock, 3);
  layout.accel_bias = place(kAccelBiasBlock, 3);
  layout.t_d = place(kTimeOffsetBlock, 1);
  layout.gyro_scale = place(kGyroScaleBlock, 3);
  layout.accel_scale = place(kAccelScaleBlock, 3);
  layout.accel_boresight = place(kAccelBoresightBlock, 3);
  layout.accel_t_d = place(kAccelTimeOffsetBlock, 1);
  layout.size = next - first;
  return layout;
}

StudyMeasurement gyro_measurement(const StudyState& state, const StudyLayout& layout,
                                  const ReferenceBiasColumns& reference, const ReferenceKinematics& b,
                                  const ReferenceNoise& noise) noexcept {
  const Vector3d scale = Vector3d::Ones() + state.gyro_scale;
  const Matrix3d SC = scale.asDiagonal() * state.C_b_s;
  const Vector3d omega_s = state.C_b_s * b.omega_radps;

  StudyMeasurement m;
  m.predicted = scale.cwiseProduct(omega_s) + state.gyro_bias_s_radps;
  append(m.H, layout.psi, Matrix3d(SC * skew(b.omega_radps)));
  append(m.H, layout.gyro_bias, Matrix3d(Matrix3d::Identity()));
  append(m.H, layout.t_d, Vector3d(SC * b.omega_dot_radps2));
  append(m.H, layout.gyro_scale, Matrix3d(omega_s.asDiagonal()));
  append(m.H, reference.gyro, Matrix3d(-SC));
  m.reference_covariance = noise.omega_radps * noise.omega_radps * SC * SC.transpose();
  return m;
}

StudyMeasurement accel_measurement(const StudyState& state, const StudyLayout& layout,
                                   const ReferenceBiasColumns& reference, const ReferenceKinematics& b,
                                   const ReferenceNoise& noise) noexcept {
  const Vector3d scale = Vector3d::Ones() + state.accel_scale;
  const Matrix3d C = state.C_b_s * state.accel_turn;
  const Matrix3d SC = scale.asDiagonal() * C;
  const Matrix3d W = skew(b.omega_radps);
  const Matrix3d W_dot = skew(b.omega_dot_radps2);
  const Matrix3d M = W * W + W_dot;
  const Matrix3d M_dot = W_dot * W + W * W_dot + skew(b.omega_ddot_radps3);
  const Vector3d& r = state.r_bs_b_m;
  const Vector3d f_at_s = b.f_mps2 + M * r;  // in b
  const Vector3d f_s = C * f_at_s;
  const Vector3d by_t = SC * (b.f_dot_mps3 + M_dot * r);
  const Matrix3d r_cross = skew(r);
  // d(w x (w x r))/dw, C-10.
  const Matrix3d centripetal_slope = -(skew(b.omega_radps.cross(r)) + W * r_cross);

  StudyMeasurement m;
  m.predicted = scale.cwiseProduct(f_s) + state.accel_bias_s_mps2;
  append(m.H, layout.psi, Matrix3d(scale.asDiagonal() * state.C_b_s * skew(state.accel_turn * f_at_s)));
  append(m.H, layout.accel_boresight, Matrix3d(SC * skew(f_at_s)));
  append(m.H, layout.r, Matrix3d(SC * M));
  append(m.H, layout.accel_bias, Matrix3d(Matrix3d::Identity()));
  append(m.H, layout.t_d, by_t);
  append(m.H, layout.accel_t_d, by_t);
  append(m.H, layout.accel_scale, Matrix3d(f_s.asDiagonal()));
  append(m.H, reference.gyro, Matrix3d(-SC * centripetal_slope));
  append(m.H, reference.accel, Matrix3d(-SC));

  const Matrix3d force = Matrix3d::Identity() * (noise.f_mps2 * noise.f_mps2);
  const Matrix3d euler = noise.omega_dot_radps2 * noise.omega_dot_radps2 * r_cross * r_cross.transpose();
  const Matrix3d centripetal =
      noise.omega_radps * noise.omega_radps * centripetal_slope * centripetal_slope.transpose();
  m.reference_covariance = SC * (force + euler + centripetal) * SC.transpose();
  return m;
}

void inject(StudyState& state, const StudyLayout& layout, std::span<const double> error) noexcept {
  if (layout.psi != StudyLayout::kAbsent)
    state.C_b_s = tidied(state.C_b_s * exp_so3(-error_at(error, layout.psi)));
  if (layout.r != StudyLayout::kAbsent) state.r_bs_b_m += error_at(error, layout.r);
  if (layout.gyro_bias != StudyLayout::kAbsent) state.gyro_bias_s_radps += error_at(error, layout.gyro_bias);
  if (layout.accel_bias != StudyLayout::kAbsent)
    state.accel_bias_s_mps2 += error_at(error, layout.accel_bias);
  if (layout.t_d != StudyLayout::kAbsent) state.t_d_s += error[layout.t_d];
  if (layout.gyro_scale != StudyLayout::kAbsent) state.gyro_scale += error_at(error, layout.gyro_scale);
  if (layout.accel_scale != StudyLayout::kAbsent) state.accel_scale += error_at(error, layout.accel_scale);
  if (layout.accel_boresight != StudyLayout::kAbsent)
    state.accel_turn = tidied(state.accel_turn * exp_so3(-error_at(error, layout.accel_boresight)));
  if (layout.accel_t_d != StudyLayout::kAbsent) state.accel_t_d_s += error[layout.accel_t_d];
}

double inflated_variance(double white_sd, double fast_sd, double fast_time_constant_s, double dt_s) noexcept {
  if (fast_sd == 0.0 || fast_time_constant_s <= 0.0) return white_sd * white_sd;
  const double phi = std::exp(-dt_s / fast_time_constant_s);
  return white_sd * white_sd + fast_sd * fast_sd * (1.0 + phi) / (1.0 - phi);
}

}  // namespace imuscope
