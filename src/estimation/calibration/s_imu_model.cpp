#include "estimation/calibration/s_imu_model.h"

#include <cmath>

#include "estimation/alignment/accelerometer_places.h"
#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

void append(SparseMeasurement& H, std::size_t column, const Matrix3d& block) noexcept {
  if (column == SImuLayout::kAbsent) return;
  MeasurementBlock& out = H.append(column, 3);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      out.h[i][j] = block(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }
}

void append(SparseMeasurement& H, std::size_t column, const Vector3d& block) noexcept {
  if (column == SImuLayout::kAbsent) return;
  MeasurementBlock& out = H.append(column, 1);
  for (std::size_t i = 0; i < 3; ++i) out.h[i][0] = block(static_cast<Eigen::Index>(i));
}

Vector3d error_at(std::span<const double> error, std::size_t first) noexcept {
  return {error[first], error[first + 1], error[first + 2]};
}

/// I + diag(scale) + E: C-18.
Matrix3d shape(const Vector3d& scale, const Vector3d& axes) noexcept {
  Matrix3d m;
  m << 1.0 + scale.x(), axes.z(), axes.y(),  //
      axes.z(), 1.0 + scale.y(), axes.x(),   //
      axes.y(), axes.x(), 1.0 + scale.z();
  return m;
}

/// d(E v)/d(axes), C-18.
Matrix3d by_axes(const Vector3d& v) noexcept {
  Matrix3d m;
  m << 0.0, v.z(), v.y(),  //
      v.z(), 0.0, v.x(),   //
      v.y(), v.x(), 0.0;
  return m;
}

/// C-2, from the mean of w w'.
Matrix3d lever_matrix(const ReferenceMean& b) noexcept {
  return b.omega_omega - b.omega_omega.trace() * Matrix3d::Identity() + skew(b.omega_dot_radps2);
}

/// C-9: derivative of C-2.
Matrix3d lever_matrix_slope(const ReferenceMean& b) noexcept {
  const Matrix3d W = skew(b.omega_radps);
  const Matrix3d W_dot = skew(b.omega_dot_radps2);
  return W_dot * W + W * W_dot + skew(b.omega_ddot_radps3);
}

/// X of C-23: covariance of a x v, for independent a and v without mean, of the covariances A and V.
Matrix3d cross_covariance(const Matrix3d& A, const Matrix3d& V) noexcept {
  const Matrix3d AV = A * V;
  return (A.trace() * V.trace() - AV.trace()) * Matrix3d::Identity() - A.trace() * V - V.trace() * A + AV +
         AV.transpose();
}

/// C-23, in b: of psi x psi x v / 2 and of psi x (a part of v that moves as V).
Matrix3d turned_covariance(const Matrix3d& psi_rad2, const Vector3d& v, const Matrix3d& V) noexcept {
  const Matrix3d v_cross = skew(v);
  return cross_covariance(psi_rad2, V + 0.5 * v_cross * psi_rad2 * v_cross.transpose());
}

/// What the places of the accelerometers add, before scale and axes. C-19.
Vector3d by_places(const SImuState& state, const Matrix3d& turned_M) noexcept {
  Vector3d sum = Vector3d::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    Vector3d place = Vector3d::Zero();
    for (Eigen::Index j = 0; j < 6; ++j) place += state.places_s_m(j) * place_basis(i, j);
    sum(i) = turned_M.row(i).dot(place);
  }
  return sum;
}

}  // namespace

ReferenceMean::ReferenceMean(const ReferenceKinematics& b) noexcept { add(1.0, b); }

// C-15: into the mean of a window.
void ReferenceMean::add(double weight, const ReferenceKinematics& b) noexcept {
  omega_radps += weight * b.omega_radps;
  omega_dot_radps2 += weight * b.omega_dot_radps2;
  omega_ddot_radps3 += weight * b.omega_ddot_radps3;
  f_mps2 += weight * b.f_mps2;
  f_dot_mps3 += weight * b.f_dot_mps3;
  omega_omega += (weight * b.omega_radps) * b.omega_radps.transpose();
}

void ReferenceMean::scale(double factor) noexcept {
  omega_radps *= factor;
  omega_dot_radps2 *= factor;
  omega_ddot_radps3 *= factor;
  f_mps2 *= factor;
  f_dot_mps3 *= factor;
  omega_omega *= factor;
}

void ReferenceMean::compensate(const Vector3d& gyro_bias_radps, const Vector3d& accel_bias_mps2) noexcept {
  const Matrix3d cross = omega_radps * gyro_bias_radps.transpose();
  omega_omega += gyro_bias_radps * gyro_bias_radps.transpose() - cross - cross.transpose();
  omega_radps -= gyro_bias_radps;
  f_mps2 -= accel_bias_mps2;
}

void ReferenceMean::move(double dt_s) noexcept {
  const Matrix3d cross = dt_s * omega_dot_radps2 * omega_radps.transpose();
  omega_omega += cross + cross.transpose();
  omega_radps += dt_s * omega_dot_radps2;
  omega_dot_radps2 += dt_s * omega_ddot_radps3;
  f_mps2 += dt_s * f_dot_mps3;
}

// E-1
SImuLayout SImuLayout::make(std::uint32_t blocks, std::size_t first) noexcept {
  SImuLayout layout;
  layout.first = first;
  std::size_t next = first;
  const auto place = [&](SImuBlock block, std::size_t width) {
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
  layout.gyro_axes = place(kGyroAxesBlock, 3);
  layout.accel_axes = place(kAccelAxesBlock, 3);
  layout.places = place(kAccelPlacesBlock, 6);
  layout.g_sensitivity = place(kGSensitivityBlock, 9);
  layout.reference_accel_t_d = place(kReferenceAccelTimeOffsetBlock, 1);
  layout.size = next - first;
  return layout;
}

Vector3d predicted_rate(const SImuState& state, const ReferenceMean& b) noexcept {
  const Vector3d f_s = state.C_b_s * (b.f_mps2 + lever_matrix(b) * state.r_bs_b_m);
  // C-3 with the axes of C-18; C-20: g-sensitivity
  return shape(state.gyro_scale, state.gyro_axes) * (state.C_b_s * b.omega_radps) +
         state.g_sensitivity * f_s + state.gyro_bias_s_radps;
}

Vector3d predicted_force(const SImuState& state, const ReferenceMean& b) noexcept {
  // C-16a
  const Matrix3d M = lever_matrix(b) + state.reference_accel_t_d_s * lever_matrix_slope(b);
  // C-16: rotation of the accelerometers' triad
  const Matrix3d C = state.C_b_s * state.accel_turn;
  // C-7, C-19: what each feels at its place
  const Vector3d f_s =
      C * (b.f_mps2 + M * state.r_bs_b_m) + by_places(state, C * M * state.C_b_s.transpose());
  // C-7 with the axes of C-18
  return shape(state.accel_scale, state.accel_axes) * f_s + state.accel_bias_s_mps2;
}

SImuMeasurement gyro_measurement(const SImuState& state, const SImuLayout& layout,
                                 const ReferenceBiasColumns& reference, const ReferenceMean& b,
                                 const ReferenceMean& for_H, const ReferenceNoise& noise) noexcept {
  // C-18: scale and axes
  const Matrix3d GC = shape(state.gyro_scale, state.gyro_axes) * state.C_b_s;
  const Vector3d omega_s = state.C_b_s * for_H.omega_radps;

  SImuMeasurement m;
  m.predicted = predicted_rate(state, b);
  // C-4: boresight
  append(m.H, layout.psi, Matrix3d(GC * skew(for_H.omega_radps)));
  // C-5: bias, time offset, scale
  append(m.H, layout.gyro_bias, Matrix3d(Matrix3d::Identity()));
  append(m.H, layout.t_d, Vector3d(GC * for_H.omega_dot_radps2));
  append(m.H, layout.gyro_scale, Matrix3d(omega_s.asDiagonal()));
  // C-18: axes
  append(m.H, layout.gyro_axes, by_axes(omega_s));
  // C-20: g-sensitivity, row by row
  if (layout.g_sensitivity != SImuLayout::kAbsent) {
    const Vector3d f_s = state.C_b_s * (for_H.f_mps2 + lever_matrix(for_H) * state.r_bs_b_m);
    for (std::size_t i = 0; i < 3; ++i) {
      Matrix3d row = Matrix3d::Zero();
      row.row(static_cast<Eigen::Index>(i)) = f_s.transpose();
      append(m.H, layout.g_sensitivity + 3 * i, row);
    }
  }
  // C-6: the reference's gyro bias
  append(m.H, reference.gyro, Matrix3d(-GC));
  // C-26: the reference's noise
  m.reference_covariance = noise.omega_radps * noise.omega_radps * GC * GC.transpose();
  return m;
}

SImuMeasurement accel_measurement(const SImuState& state, const SImuLayout& layout,
                                  const ReferenceBiasColumns& reference, const ReferenceMean& b,
                                  const ReferenceMean& for_H, const ReferenceNoise& noise) noexcept {
  // C-18: scale and axes; C-16: rotation of the accelerometers' triad
  const Matrix3d B = shape(state.accel_scale, state.accel_axes);
  const Matrix3d C = state.C_b_s * state.accel_turn;
  const Matrix3d BC = B * C;
  const Matrix3d W = skew(for_H.omega_radps);
  const Matrix3d M_dot = lever_matrix_slope(for_H);
  const Matrix3d M = lever_matrix(for_H) + state.reference_accel_t_d_s * M_dot;
  const Vector3d& r = state.r_bs_b_m;
  const Vector3d f_at_s = for_H.f_mps2 + M * r;  // in b
  const Matrix3d CMC = C * M * state.C_b_s.transpose();
  // C-19: what each feels at its place
  const Vector3d f_s = C * f_at_s + by_places(state, CMC);
  // C-9: change with time
  const Vector3d by_t = BC * (for_H.f_dot_mps3 + M_dot * r);
  const Matrix3d r_cross = skew(r);
  // d(w x (w x r))/dw, C-10.
  const Matrix3d centripetal_slope = -(skew(for_H.omega_radps.cross(r)) + W * r_cross);

  SImuMeasurement m;
  m.predicted = predicted_force(state, b);
  // C-8, as C-16 has it: boresights of both triads
  append(m.H, layout.psi, Matrix3d(B * state.C_b_s * skew(state.accel_turn * f_at_s)));
  append(m.H, layout.accel_boresight, Matrix3d(BC * skew(f_at_s)));
  // C-9: lever arm
  append(m.H, layout.r, Matrix3d(BC * M));
  // C-11: bias
  append(m.H, layout.accel_bias, Matrix3d(Matrix3d::Identity()));
  // C-9, C-16: time offsets
  append(m.H, layout.t_d, by_t);
  append(m.H, layout.accel_t_d, by_t);
  // C-16a: what is made of the reference's rates
  if (layout.reference_accel_t_d != SImuLayout::kAbsent) {
    const Matrix3d CMC_dot = C * M_dot * state.C_b_s.transpose();
    append(m.H, layout.reference_accel_t_d, Vector3d(B * (C * M_dot * r + by_places(state, CMC_dot))));
  }
  // C-11: scale; C-18: axes
  append(m.H, layout.accel_scale, Matrix3d(f_s.asDiagonal()));
  append(m.H, layout.accel_axes, by_axes(f_s));
  // C-19: places, three columns at a time
  if (layout.places != SImuLayout::kAbsent) {
    for (Eigen::Index first = 0; first < 6; first += 3) {
      Matrix3d columns;
      for (Eigen::Index i = 0; i < 3; ++i) {
        for (Eigen::Index j = 0; j < 3; ++j) columns(i, j) = CMC.row(i).dot(place_basis(i, first + j));
      }
      append(m.H, layout.places + static_cast<std::size_t>(first), Matrix3d(B * columns));
    }
  }
  // C-10, C-11: the reference's biases
  append(m.H, reference.gyro, Matrix3d(-BC * centripetal_slope));
  append(m.H, reference.accel, Matrix3d(-BC));

  // C-26: the reference's noise in forces, in the derivative of its rates, in the rates
  const Matrix3d force = Matrix3d::Identity() * (noise.f_mps2 * noise.f_mps2);
  const Matrix3d euler = noise.omega_dot_radps2 * noise.omega_dot_radps2 * r_cross * r_cross.transpose();
  const Matrix3d centripetal =
      noise.omega_radps * noise.omega_radps * centripetal_slope * centripetal_slope.transpose();
  m.reference_covariance = BC * (force + euler + centripetal) * BC.transpose();
  return m;
}

// C-23, of rates
Matrix3d second_order_rate(const SImuState& state, const ReferenceMean& b,
                           const LinearisationSpread& spread) noexcept {
  const Matrix3d by_time = spread.t_d_s2 * b.omega_dot_radps2 * b.omega_dot_radps2.transpose();
  return state.C_b_s * turned_covariance(spread.psi_rad2, b.omega_radps, by_time) * state.C_b_s.transpose();
}

// C-23, of forces
Matrix3d second_order_force(const SImuState& state, const ReferenceMean& b,
                            const LinearisationSpread& spread) noexcept {
  const Matrix3d M = lever_matrix(b);
  const Matrix3d M_dot = lever_matrix_slope(b);
  const Vector3d by_t = b.f_dot_mps3 + M_dot * state.r_bs_b_m;
  const Matrix3d first_order = M * spread.r_m2 * M.transpose() + spread.t_d_s2 * by_t * by_t.transpose();
  const Matrix3d in_b = turned_covariance(spread.psi_rad2, b.f_mps2 + M * state.r_bs_b_m, first_order) +
                        spread.t_d_s2 * M_dot * spread.r_m2 * M_dot.transpose();
  const Matrix3d C = state.C_b_s * state.accel_turn;
  return C * in_b * C.transpose();
}

// C-12; the boresights by C-1 and C-16
void inject(SImuState& state, const SImuLayout& layout, std::span<const double> error) noexcept {
  if (layout.psi != SImuLayout::kAbsent)
    state.C_b_s = tidied(state.C_b_s * exp_so3(-error_at(error, layout.psi)));
  if (layout.r != SImuLayout::kAbsent) state.r_bs_b_m += error_at(error, layout.r);
  if (layout.gyro_bias != SImuLayout::kAbsent) state.gyro_bias_s_radps += error_at(error, layout.gyro_bias);
  if (layout.accel_bias != SImuLayout::kAbsent) state.accel_bias_s_mps2 += error_at(error, layout.accel_bias);
  if (layout.t_d != SImuLayout::kAbsent) state.t_d_s += error[layout.t_d];
  if (layout.gyro_scale != SImuLayout::kAbsent) state.gyro_scale += error_at(error, layout.gyro_scale);
  if (layout.accel_scale != SImuLayout::kAbsent) state.accel_scale += error_at(error, layout.accel_scale);
  if (layout.accel_boresight != SImuLayout::kAbsent)
    state.accel_turn = tidied(state.accel_turn * exp_so3(-error_at(error, layout.accel_boresight)));
  if (layout.accel_t_d != SImuLayout::kAbsent) state.accel_t_d_s += error[layout.accel_t_d];
  if (layout.gyro_axes != SImuLayout::kAbsent) state.gyro_axes += error_at(error, layout.gyro_axes);
  if (layout.accel_axes != SImuLayout::kAbsent) state.accel_axes += error_at(error, layout.accel_axes);
  if (layout.places != SImuLayout::kAbsent) {
    for (std::size_t j = 0; j < 6; ++j)
      state.places_s_m(static_cast<Eigen::Index>(j)) += error[layout.places + j];
  }
  if (layout.reference_accel_t_d != SImuLayout::kAbsent)
    state.reference_accel_t_d_s += error[layout.reference_accel_t_d];
  if (layout.g_sensitivity == SImuLayout::kAbsent) return;
  for (std::size_t i = 0; i < 3; ++i)
    state.g_sensitivity.row(static_cast<Eigen::Index>(i)) +=
        error_at(error, layout.g_sensitivity + 3 * i).transpose();
}

// C-14
double inflated_variance(double white_sd, double fast_sd, double fast_time_constant_s, double dt_s) noexcept {
  if (fast_sd == 0.0 || fast_time_constant_s <= 0.0) return white_sd * white_sd;
  const double phi = std::exp(-dt_s / fast_time_constant_s);
  return white_sd * white_sd + fast_sd * fast_sd * (1.0 + phi) / (1.0 - phi);
}

}  // namespace imuscope
