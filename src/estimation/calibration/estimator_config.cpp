#include "estimation/calibration/estimator_config.h"

#include <cmath>

namespace imuscope {
namespace {

// Paper, Table II: gyro of an MTx, variances in (deg/s)^2, beta in 1/s.
struct TableTwo {
  double white_variance;
  double slow_beta;
  double slow_variance;
  double fast_beta;
  double fast_variance;
};
constexpr TableTwo kStaticModel{0.50552, 0.00492, 0.00142, 113.51523, 0.05528};
constexpr TableTwo kDynamicModel{0.65382, 0.00155, 0.00981, 1.68012, 0.00168};

// The paper has no accelerometer model: an assumption of the MTx's class.
constexpr double kAccelWhite_mps2 = 0.03;
constexpr double kAccelSlow_mps2 = 0.02;
constexpr double kAccelSlow_s = 645.0;

TriadNoise gyro_noise(const TableTwo& model) {
  TriadNoise noise;
  noise.white_sd.fill(std::sqrt(model.white_variance) * kRadPerDeg);
  noise.fast_sd.fill(std::sqrt(model.fast_variance) * kRadPerDeg);
  noise.fast_time_constant_s.fill(1.0 / model.fast_beta);
  return noise;
}

}  // namespace

SImuNoise mtx_class_noise() {
  SImuNoise noise;
  noise.gyro[static_cast<std::size_t>(Regime::kStatic)] = gyro_noise(kStaticModel);
  noise.gyro[static_cast<std::size_t>(Regime::kDynamic)] = gyro_noise(kDynamicModel);
  for (TriadNoise& accel : noise.accel) accel.white_sd.fill(kAccelWhite_mps2);
  // One bias process serves both regimes: the livelier, dynamic one.
  noise.gyro_bias.fill({std::sqrt(kDynamicModel.slow_variance) * kRadPerDeg, 1.0 / kDynamicModel.slow_beta});
  noise.accel_bias.fill({kAccelSlow_mps2, kAccelSlow_s});
  return noise;
}

// N-28
Vector3 start_accel_bias_sd_mps2(const ReferenceConfig& config) noexcept {
  const double level = kMps2PerG * std::hypot(config.grade.lean_sd_rad, config.grade.triad_sd_rad);
  const double turn_on = config.accel_bias.sd;
  return {std::hypot(turn_on, level), std::hypot(turn_on, level),
          std::hypot(turn_on, kMps2PerG * config.grade.scale_sd)};
}

}  // namespace imuscope
