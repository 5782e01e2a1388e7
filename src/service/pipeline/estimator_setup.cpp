#include "service/pipeline/estimator_setup.h"

#include <cmath>

namespace imuscope {

namespace {

Vector3 all_axes(double value) { return {value, value, value}; }

/// The R bias is one Gauss-Markov state. Where a turn-on bias and a slow process are both given, its sd is
/// the turn-on's and its time constant such that it wanders as fast as the slow process does (equal 2 sd^2 /
/// tau).
void set_reference_bias(const std::optional<double>& turn_on_sd, const std::optional<double>& gm_sd,
                        const std::optional<double>& gm_tau_s, GaussMarkovConfig& bias) {
  if (turn_on_sd) bias.sd = *turn_on_sd;
  if (gm_tau_s) bias.time_constant_s = *gm_tau_s;
  if (gm_sd && *gm_sd > 0.0 && bias.sd > *gm_sd)
    bias.time_constant_s *= bias.sd * bias.sd / (*gm_sd * *gm_sd);
}

ReferenceConfig reference_config(const Configuration& configuration) {
  const auto index = configuration.reference_index();
  const auto& device = configuration.devices[index];
  ReferenceConfig reference;
  reference.device = static_cast<DeviceIndex>(index);
  reference.rate_hz = device.rate_hz;
  reference.differentiator_points = configuration.estimator.differentiator_points;
  const double per_sqrt_hz = 1.0 / std::sqrt(device.rate_hz);
  const auto& noise = device.noise;
  if (noise.gyro_white_sd_radps)
    reference.gyro_white_radps_per_sqrt_hz = *noise.gyro_white_sd_radps * per_sqrt_hz;
  reference.is_known = noise.gyro_white_sd_radps || traits_of(device.protocol).has_optical_gyros;
  reference.grade = reference_grade(reference.is_known ? reference.gyro_white_radps_per_sqrt_hz
                                                       : kIndustrialGyroWhite_radps_per_sqrt_hz);
  if (noise.accel_white_sd_mps2)
    reference.accel_white_mps2_per_sqrt_hz = *noise.accel_white_sd_mps2 * per_sqrt_hz;
  set_reference_bias(noise.gyro_bias_sd_radps, noise.gyro_gm_sd_radps, noise.gyro_gm_tau_s,
                     reference.gyro_bias);
  set_reference_bias(noise.accel_bias_sd_mps2, noise.accel_gm_sd_mps2, noise.accel_gm_tau_s,
                     reference.accel_bias);
  return reference;
}

void set_triad(const std::optional<double>& white_sd, const std::optional<double>& white_sd_static,
               std::array<TriadNoise, kRegimeCount>& triad) {
  constexpr auto kStatic = static_cast<std::size_t>(Regime::kStatic);
  if (white_sd) triad = {TriadNoise{all_axes(*white_sd), {}, {}}, TriadNoise{all_axes(*white_sd), {}, {}}};
  if (white_sd_static) triad[kStatic] = TriadNoise{all_axes(*white_sd_static), {}, {}};
}

void set_bias(const std::optional<double>& sd, const std::optional<double>& tau_s,
              std::array<GaussMarkovConfig, 3>& bias) {
  for (auto& axis : bias) {
    if (sd) axis.sd = *sd;
    if (tau_s) axis.time_constant_s = *tau_s;
  }
}

std::uint32_t blocks_of(FilterStates states) {
  switch (states) {
    case FilterStates::kRigid:
      return kFullSImuBlocks;
    case FilterStates::kPaper:
      return kPaperSImuBlocks;
    case FilterStates::kFull:
      break;
  }
  return kCompleteSImuBlocks;
}

SImuConfig study_config(const DeviceConfig& device, std::size_t index, FilterStates states) {
  SImuConfig study;
  study.device = static_cast<DeviceIndex>(index);
  study.rate_hz = device.rate_hz;
  study.average_samples = device.average_samples;
  study.blocks = blocks_of(states);
  const auto& noise = device.noise;
  set_triad(noise.gyro_white_sd_radps, noise.gyro_white_sd_static_radps, study.noise.gyro);
  set_triad(noise.accel_white_sd_mps2, noise.accel_white_sd_static_mps2, study.noise.accel);
  set_bias(noise.gyro_gm_sd_radps, noise.gyro_gm_tau_s, study.noise.gyro_bias);
  set_bias(noise.accel_gm_sd_mps2, noise.accel_gm_tau_s, study.noise.accel_bias);
  if (noise.gyro_bias_sd_radps) study.turn_on_gyro_sd_radps = all_axes(*noise.gyro_bias_sd_radps);
  if (noise.accel_bias_sd_mps2) study.turn_on_accel_sd_mps2 = all_axes(*noise.accel_bias_sd_mps2);
  if (noise.gyro_scale_sd) study.prior_gyro_scale_sd = all_axes(*noise.gyro_scale_sd);
  if (noise.accel_scale_sd) study.prior_accel_scale_sd = all_axes(*noise.accel_scale_sd);

  const auto& prior = device.prior;
  study.prior_C_b_s = prior.C_b_s;
  if (prior.boresight_sd_rad) study.prior_boresight_sd_rad = all_axes(*prior.boresight_sd_rad);
  study.prior_r_bs_b_m = prior.r_bs_b_m;
  if (prior.lever_arm_sd_m) study.prior_r_bs_b_sd_m = all_axes(*prior.lever_arm_sd_m);
  study.prior_t_d_s = prior.time_offset_s;
  if (prior.time_offset_sd_s) study.prior_t_d_sd_s = *prior.time_offset_sd_s;
  if (prior.accel_boresight_sd_rad) {
    study.blocks |= kAccelBoresightBlock;
    study.prior_accel_boresight_sd_rad = all_axes(*prior.accel_boresight_sd_rad);
  }
  if (prior.accel_time_offset_sd_s) {
    study.blocks |= kAccelTimeOffsetBlock;
    study.prior_accel_t_d_sd_s = *prior.accel_time_offset_sd_s;
  }
  study.boresight_creep_rad_per_sqrt_s = prior.creep_rad_per_sqrt_s;
  return study;
}

GnssConfig gnss_config(const DeviceConfig& device, std::size_t index) {
  GnssConfig gnss;
  gnss.enabled = true;
  gnss.device = static_cast<DeviceIndex>(index);
  gnss.antenna_lever_arm_b_m = device.gnss.antenna_lever_arm_b_m;
  gnss.antenna_lever_arm_sd_m = all_axes(device.gnss.antenna_lever_arm_sd_m);
  gnss.latency_s = device.gnss.latency_s;
  gnss.latency_sd_s = device.gnss.latency_sd_s;
  gnss.default_sd_position_m = device.gnss.position_sd_m;
  gnss.default_sd_velocity_mps = device.gnss.velocity_sd_mps;
  gnss.floor_sd_position_m = all_axes(device.gnss.position_sd_floor_m);
  gnss.floor_sd_velocity_mps = all_axes(device.gnss.velocity_sd_floor_mps);
  return gnss;
}

OdometryConfig odometry_config(const DeviceConfig& device, std::size_t index) {
  const OdometryOptions& options = device.odometry;
  OdometryConfig odometry;
  odometry.enabled = true;
  odometry.device = static_cast<DeviceIndex>(index);
  odometry.rate_hz = device.rate_hz;
  odometry.use_speed = options.use_speed;
  odometry.use_non_holonomic = options.use_non_holonomic;
  odometry.use_zero_velocity = options.use_zero_velocity;
  odometry.prior_r_bv_b_m = options.axle_lever_arm_b_m;
  odometry.prior_r_bv_b_sd_m = all_axes(options.axle_lever_arm_sd_m);
  odometry.prior_mount_sd_rad = options.mounting_sd_rad;
  odometry.prior_scale_sd = options.scale_sd;
  odometry.speed_sd_mps = options.speed_sd_mps;
  odometry.sideways_sd_mps = options.sideways_sd_mps;
  odometry.upwards_sd_mps = options.upwards_sd_mps;
  odometry.zero_velocity_sd_mps = options.zero_velocity_sd_mps;
  odometry.dead_band_mps = options.dead_band_mps;
  return odometry;
}

}  // namespace

EstimatorConfig estimator_config(const Configuration& configuration) {
  EstimatorConfig config;
  config.reference = reference_config(configuration);
  for (const auto index : configuration.study_indices()) {
    config.studies.push_back(
        study_config(configuration.devices[index], index, configuration.estimator.states));
  }
  if (const auto index = configuration.gnss_index()) {
    config.gnss = gnss_config(configuration.devices[*index], *index);
  }
  if (const auto index = configuration.odometry_index()) {
    config.odometry = odometry_config(configuration.devices[*index], *index);
  }
  config.navigation.enabled = configuration.estimator.navigation && config.gnss.enabled;
  return config;
}

SImuConfig with_mounting(SImuConfig study, const KnownMounting& known) {
  study.blocks = kBiasSImuBlocks;
  study.prior_C_b_s = known.C_b_s;
  study.prior_r_bs_b_m = known.r_bs_b_m;
  study.prior_t_d_s = known.t_d_s;
  study.prior_gyro_scale = known.gyro_scale;
  study.prior_accel_scale = known.accel_scale;
  return study;
}

}  // namespace imuscope
