#include "estimation/batch/sensor_model.h"

#include <Eigen/Geometry>
#include <array>
#include <limits>

#include "estimation/alignment/accelerometer_places.h"
#include "estimation/navigation/so3.h"

namespace imuscope::batch {

namespace {

using Row33 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// Row and column of each of the six parameters of a lower triangle.
constexpr std::array<std::array<Eigen::Index, 2>, 6> kTriangle{
    {{0, 0}, {1, 1}, {2, 2}, {1, 0}, {2, 0}, {2, 1}}};

/// Of B-4 and B-5: the identity with scales and departures from right angles.
Eigen::Matrix3d shape(const ParameterVector& x, Eigen::Index first, double above) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  for (Eigen::Index j = 0; j < 6; ++j) m += x[first + j] * shape_derivative(j, above);
  return m;
}

/// The frame with x along a triad's x axis and y in the plane of its x and y axes, which are its rows.
Eigen::Matrix3d axes_frame(const Eigen::Matrix3d& triad) {
  Eigen::Matrix3d frame;
  frame.row(0) = triad.row(0).normalized();
  frame.row(1) = (triad.row(1) - triad.row(1).dot(frame.row(0)) * frame.row(0)).normalized();
  frame.row(2) = frame.row(0).cross(frame.row(1));
  return frame;
}

Eigen::Matrix<double, 6, 1> triangle_of(const Eigen::Matrix3d& triangular) {
  Eigen::Matrix<double, 6, 1> shape;
  for (Eigen::Index j = 0; j < 6; ++j) {
    const auto& [row, column] = kTriangle[static_cast<std::size_t>(j)];
    shape[j] = triangular(row, column) - (row == column ? 1.0 : 0.0);
  }
  return shape;
}

/// w of B-24: derivative of the rotation vector, in s, from a triad's symmetric frame to that of its axes in its three
/// departures yx, zx, zy.
Eigen::Matrix3d turn_derivative() {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
  turn(0, 2) = 0.5;
  turn(1, 1) = -0.5;
  turn(2, 0) = 0.5;
  return turn;
}

}  // namespace

Eigen::Matrix3d shape_derivative(Eigen::Index j, double above) {
  const auto& [row, column] = kTriangle[static_cast<std::size_t>(j)];
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  m(row, column) = row == column ? 1.0 : 1.0 - above;
  if (row != column) m(column, row) = above;
  return m;
}

Eigen::Matrix3d SensorState::gyro_shape() const { return shape(x, kGyroShape, above); }
Eigen::Matrix3d SensorState::accel_shape() const { return shape(x, kAccelShape, above); }
// B-5
Eigen::Matrix3d SensorState::C_s_accel() const { return exp_so3(-x.segment<3>(kAlpha)); }
Eigen::Matrix3d SensorState::C_b_accel() const { return accel_shape() * C_s_accel() * C_b_s; }
Eigen::Matrix3d SensorState::g_sensitivity() const {
  return Row33(Eigen::Map<const Row33>(x.data() + kGSensitivity));
}
Eigen::Matrix3d SensorState::flexure() const { return Row33(Eigen::Map<const Row33>(x.data() + kFlexure)); }
Eigen::Matrix3d SensorState::accel_flexure() const {
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  for (Eigen::Index j = 0; j < 6; ++j) m(flexure_row(j), flexure_column(j)) = x[kAccelFlexure + j];
  return m;
}
Eigen::Matrix3d SensorState::compliance() const {
  return Row33(Eigen::Map<const Row33>(x.data() + kCompliance));
}

Eigen::Vector3d SensorState::place_s_m(Eigen::Index axis) const {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (Eigen::Index j = 0; j < 6; ++j) place += x[kPlaces + j] * place_basis(axis, j);
  return place;
}

void SensorState::add(const ParameterVector& correction) {
  C_b_s = C_b_s * exp_so3(-correction.segment<3>(kPsi));
  // A product of many rotations drifts from one.
  C_b_s = Eigen::Quaterniond(C_b_s).normalized().toRotationMatrix();
  // alpha is turned as a rotation, too, so that large ones stay exact.
  const Eigen::Matrix3d turned = exp_so3(-correction.segment<3>(kAlpha)) * C_s_accel();
  x += correction;
  x.segment<3>(kPsi).setZero();
  x.segment<3>(kAlpha) = -log_so3(turned);
}

// B-24
AxesFrame in_axes_frame(const SensorState& symmetric) {
  AxesFrame out{symmetric, {}};
  const Eigen::Matrix3d gyros = symmetric.C_b_gyro();
  const Eigen::Matrix3d accels = symmetric.C_b_accel();
  SensorState& sensor = out.sensor;
  sensor.above = 0.0;
  sensor.C_b_s = axes_frame(gyros);
  const Eigen::Matrix3d C_b_accel_axes = axes_frame(accels);
  sensor.x.segment<6>(kGyroShape) = triangle_of(gyros * sensor.C_b_s.transpose());
  sensor.x.segment<3>(kAlpha) = -log_so3(C_b_accel_axes * sensor.C_b_s.transpose());
  sensor.x.segment<6>(kAccelShape) = triangle_of(accels * C_b_accel_axes.transpose());
  // B-24, to first order
  out.derivative.setIdentity();
  const Eigen::Matrix3d turn = turn_derivative();
  out.derivative.block<3, 3>(kPsi, kGyroShape + 3) = symmetric.C_b_s.transpose() * turn;
  out.derivative.block<3, 3>(kAlpha, kGyroShape + 3) = -turn;
  out.derivative.block<3, 3>(kAlpha, kAccelShape + 3) = turn;
  return out;
}

ParameterVector prior_sd(const SensorClass& sensor) {
  ParameterVector sd;
  sd.segment<3>(kPsi).setConstant(std::numeric_limits<double>::infinity());
  sd.segment<3>(kLeverArm).setConstant(sensor.lever_arm_sd_m);
  sd[kTimeOffset] = std::numeric_limits<double>::infinity();
  sd[kClockRate] = sensor.clock_rate_sd;
  sd.segment<3>(kGyroBias).setConstant(sensor.gyro_bias_sd_radps);
  sd.segment<3>(kAccelBias).setConstant(sensor.accel_bias_sd_mps2);
  sd.segment<3>(kGyroShape).setConstant(sensor.gyro_scale_sd);
  sd.segment<3>(kGyroShape + 3).setConstant(sensor.axis_sd_rad);
  sd.segment<3>(kAlpha).setConstant(sensor.triad_sd_rad);
  sd.segment<3>(kAccelShape).setConstant(sensor.accel_scale_sd);
  sd.segment<3>(kAccelShape + 3).setConstant(sensor.axis_sd_rad);
  sd[kAccelDelay] = sensor.accel_delay_sd_s;
  sd.segment<6>(kPlaces).setConstant(sensor.place_sd_m);
  sd.segment<9>(kGSensitivity).setConstant(sensor.g_sensitivity_sd);
  sd.segment<9>(kFlexure).setConstant(sensor.flexure_sd);
  sd.segment<3>(kAccelFade).setConstant(sensor.accel_fade_sd);
  sd.segment<6>(kAccelFlexure).setConstant(sensor.accel_flexure_sd);
  sd.segment<9>(kCompliance).setConstant(sensor.compliance_sd);
  sd.segment<2>(kDispersion).setConstant(sensor.dispersion_sd_s);
  sd[kReferenceAccelDelay] = sensor.accel_delay_sd_s;
  sd[kReferenceAccelDelay + 1] = sensor.dispersion_sd_s;
  sd.segment<3>(kShaking).setConstant(sensor.shaking_sd_m);
  return sd;
}

}  // namespace imuscope::batch
