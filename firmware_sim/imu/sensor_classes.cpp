#include "firmware_sim/imu/sensor_classes.h"

#include "firmware_sim/motion/degrees.h"
#include "firmware_sim/motion/draw.h"

namespace imusim {
namespace {

constexpr double kRad2PerDeg2 = kRadPerDeg * kRadPerDeg;

// Table II of the paper, (deg/s)^2 and 1/s.
AxisNoise table2_static() {
  return {0.50552 * kRad2PerDeg2, {{0.00142 * kRad2PerDeg2, 0.00492}, {0.05528 * kRad2PerDeg2, 113.51523}}};
}
AxisNoise table2_dynamic() {
  return {0.65382 * kRad2PerDeg2, {{0.00981 * kRad2PerDeg2, 0.00155}, {0.00168 * kRad2PerDeg2, 1.68012}}};
}

std::array<RegimeNoise, 3> all_axes(const RegimeNoise& noise) { return {noise, noise, noise}; }

}  // namespace

RegimeNoise mtx_gyro_noise(GyroNoiseChoice choice) {
  switch (choice) {
    case GyroNoiseChoice::kAllStatic:
      return same_in_both(table2_static());
    case GyroNoiseChoice::kAllDynamic:
      return same_in_both(table2_dynamic());
    case GyroNoiseChoice::kByRegime:
      break;
  }
  return {table2_static(), table2_dynamic()};
}

RegimeNoise mtx_accel_noise(double white_sd_mps2) {
  constexpr double kGaussMarkovSd_mps2 = 0.02;
  constexpr double kCorrelationTime_s = 645.0;
  return same_in_both({white_sd_mps2 * white_sd_mps2,
                       {{kGaussMarkovSd_mps2 * kGaussMarkovSd_mps2, 1.0 / kCorrelationTime_s}}});
}

ImuErrors draw_mtx(const MtxClass& mtx, Random& random) {
  ImuErrors errors;
  errors.regime_switch = mtx.regime_switch;
  errors.gyro.noise = all_axes(mtx_gyro_noise(mtx.gyro_noise));
  errors.accel.noise = all_axes(mtx_accel_noise(mtx.accel_white_sd_mps2));
  errors.gyro.bias = draw3(random, mtx.gyro_bias_sd_radps);
  errors.accel.bias = draw3(random, mtx.accel_bias_sd_mps2);
  errors.gyro.scale = draw3(random, mtx.gyro_scale_sd);
  errors.accel.scale = draw3(random, mtx.accel_scale_sd);
  return errors;
}

ReferenceClass reference_class(int number) {
  constexpr double kPerSqrtHour = kRadPerDeg / 60.0;
  constexpr double kPerHour = kRadPerDeg / 3600.0;
  constexpr double kMicroG = 9.80665e-6;
  // Orders of magnitude of public data sheets of each kind; the last is an MTx at 100 Hz.
  static const std::array<ReferenceClass, kReferenceClasses> classes = {
      ReferenceClass{},
      {0.03 * kPerSqrtHour, 30.0 * kMicroG, 0.5 * kPerHour, 2e-3},
      {0.125 * kPerSqrtHour, 60.0 * kMicroG, 3.0 * kPerHour, 5e-3},
      {0.3 * kPerSqrtHour, 100.0 * kMicroG, 30.0 * kPerHour, 1e-2},
      {4.8 * kPerSqrtHour, 300.0 * kMicroG, 1080.0 * kPerHour, 5e-2},
  };
  return classes.at(static_cast<std::size_t>(number - 1));
}

ImuErrors draw_reference(const ReferenceClass& airins, double rate_hz, Random& random) {
  const auto white = [rate_hz](double density) { return same_in_both({density * density * rate_hz, {}}); };
  ImuErrors errors;
  errors.gyro.noise = all_axes(white(airins.gyro_white_radps_per_sqrt_hz));
  errors.accel.noise = all_axes(white(airins.accel_white_mps2_per_sqrt_hz));
  errors.gyro.bias = draw3(random, airins.gyro_bias_sd_radps);
  errors.accel.bias = draw3(random, airins.accel_bias_sd_mps2);
  return errors;
}

}  // namespace imusim
