/// What a configuration tells the estimator, whole: every key once, and none of them.

#include "service/pipeline/estimator_setup.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::Answer;

void add(Answer& answer, const std::string& name, const GaussMarkovConfig& bias) {
  answer.line(name, bias.sd, bias.time_constant_s);
}

void add(Answer& answer, const SImuConfig& s) {
  answer.line("study", s.device, s.rate_hz, s.blocks, s.noise_floor_share, s.average_samples);
  for (const auto* triad : {&s.noise.gyro, &s.noise.accel})
    for (const TriadNoise& noise : *triad)
      answer.line("noise", noise.white_sd, noise.fast_sd, noise.fast_time_constant_s);
  for (const auto* triad : {&s.noise.gyro_bias, &s.noise.accel_bias})
    for (const auto& bias : *triad) add(answer, "bias", bias);
  answer.line("boresight", s.prior_C_b_s, s.prior_boresight_sd_rad, s.boresight_creep_rad_per_sqrt_s);
  answer.line("lever arm", s.prior_r_bs_b_m, s.prior_r_bs_b_sd_m);
  answer.line("time", s.prior_t_d_s, s.prior_t_d_sd_s, s.coarse_search_s);
  answer.line("accelerometers", s.prior_accel_boresight_sd_rad, s.prior_accel_t_d_sd_s);
  answer.line("sensor", s.prior_axes_sd_rad, s.prior_place_sd_m, s.prior_g_sensitivity_sd);
  answer.line("biases", s.prior_gyro_bias_radps, s.turn_on_gyro_sd_radps, s.prior_accel_bias_mps2,
              s.turn_on_accel_sd_mps2);
  answer.line("scales", s.prior_gyro_scale, s.prior_gyro_scale_sd, s.prior_accel_scale,
              s.prior_accel_scale_sd);
}

void add(Answer& answer, const EstimatorConfig& c) {
  const ReferenceConfig& r = c.reference;
  answer.line("reference", r.device, r.rate_hz, r.differentiator_points, r.is_known,
              r.gyro_white_radps_per_sqrt_hz, r.accel_white_mps2_per_sqrt_hz, r.grade.scale_sd,
              r.grade.triad_sd_rad);
  add(answer, "gyro bias", r.gyro_bias);
  add(answer, "accel bias", r.accel_bias);
  const GnssConfig& g = c.gnss;
  answer.line("gnss", g.enabled, g.device, g.antenna_lever_arm_b_m, g.antenna_lever_arm_sd_m, g.use_velocity,
              g.latency_s, g.latency_sd_s);
  answer.line("sd", g.default_sd_position_m, g.default_sd_velocity_mps, g.floor_sd_position_m,
              g.floor_sd_velocity_mps);
  const OdometryConfig& o = c.odometry;
  answer.line("odometry", o.enabled, o.device, o.rate_hz, o.use_speed, o.use_non_holonomic,
              o.use_zero_velocity);
  answer.line("priors", o.prior_r_bv_b_m, o.prior_r_bv_b_sd_m, o.prior_mount_sd_rad, o.prior_scale_sd,
              o.scale_walk_per_sqrt_s);
  answer.line("sd", o.speed_sd_mps, o.sideways_sd_mps, o.upwards_sd_mps, o.zero_velocity_sd_mps,
              o.dead_band_mps);
  answer.line("navigation", c.navigation.enabled, c.navigation.initial_rpy_sd_rad);
  for (const auto& study : c.studies) add(answer, study);
}

constexpr const char* kTwo = R"(
[[device]]
name = "ref"
role = "reference"
protocol = "csv_imu"
rate_hz = 125
[[device]]
name = "imu"
role = "study"
protocol = "csv_imu"
)";

TEST(EstimatorSetup, WhatAConfigurationSaysAndWhatItLeavesOut) {
  Answer answer;
  const auto tell = [&](const std::string& title, const std::string& text) {
    const auto file = test::scratch_folder() / "vehicle.toml";
    std::ofstream(file) << text;
    std::filesystem::copy_file(test::source_path("config/toyota_rav4.dbc"),
                               file.parent_path() / "toyota_rav4.dbc",
                               std::filesystem::copy_options::overwrite_existing);
    const auto configuration = load_configuration(file);
    ASSERT_TRUE(configuration) << title << ": " << configuration.error().text();
    answer.line("==", title);
    add(answer, estimator_config(*configuration));
  };
  tell("nothing", kTwo);
  for (const char* states : {"rigid", "paper", "full"})
    tell(states, std::string("[estimator]\nstates = \"") + states + "\"\ndifferentiator_points = 9\n" + kTwo);
  tell("a slow one", std::string(kTwo) + "rate_hz = 50\naverage_samples = 3\n");
  const std::string noise = R"(
[device.noise]
gyro_white_sd_degps = 0.11
accel_white_sd_mps2 = 0.012
gyro_bias_sd_degps = 0.21
accel_bias_sd_mps2 = 0.022
gyro_gm_sd_degps = 0.031
gyro_gm_tau_s = 310.0
accel_gm_sd_mps2 = 0.0032
accel_gm_tau_s = 320.0
)";
  const std::string of_study = noise + R"(
gyro_white_sd_static_degps = 0.041
accel_white_sd_static_mps2 = 0.0042
gyro_scale_sd_percent = 0.51
accel_scale_sd_percent = 0.52
[device.prior]
rotation_vector_b_s_deg = [10.0, 20.0, -30.0]
boresight_sd_deg = 1.1
lever_arm_b_m = [0.4, -0.5, 0.6]
lever_arm_sd_m = 0.07
time_offset_ms = -8.0
time_offset_sd_ms = 2.5
accel_boresight_sd_deg = 0.35
accel_time_offset_sd_ms = 0.45
mount_creep_deg_per_sqrt_h = 0.06
)";
  const std::string others = R"(
[[device]]
name = "antenna"
role = "gnss"
protocol = "nmea"
antenna_lever_arm_b_m = [1.1, 1.2, -1.3]
antenna_lever_arm_sd_m = 0.14
latency_ms = 150.0
latency_sd_ms = 16.0
position_sd_m = [0.17, 0.18, 0.19]
velocity_sd_mps = [0.27, 0.28, 0.29]
position_sd_floor_m = 0.037
velocity_sd_floor_mps = 0.038
[[device]]
name = "wheels"
role = "odometry"
protocol = "can_odometry"
rate_hz = 40
[device.odometry]
dbc = "toyota_rav4.dbc"
speed_signals = ["WHEEL_SPEEDS.RR", "WHEEL_SPEEDS.RL"]
speed = true
non_holonomic = false
zero_velocity = true
axle_lever_arm_b_m = [-1.4, 0.15, 0.16]
axle_lever_arm_sd_m = 0.17
mounting_sd_deg = 1.8
scale_sd_percent = 1.9
speed_sd_mps = 0.051
)";
  std::string two = kTwo;
  const auto study = two.rfind("[[device]]");
  tell("everything", two.substr(0, study) + noise + two.substr(study) + of_study + others);
  const std::string bold = std::string(two.substr(0, study)) +
                           "[device.noise]\ngyro_gm_sd_degps = 0.5\ngyro_gm_tau_s = 50.0\n" +
                           two.substr(study) + "[device.prior]\naccel_boresight_sd_deg = 0.2\n" + others;
  tell("some", "[estimator]\nstates = \"rigid\"\nnavigation = false\n" + bold);
  test::expect_recorded("service/pipeline/estimator_setup.txt", answer.text());
}

TEST(EstimatorSetup, AKnownMountingLeavesTheBiasesAlone) {
  Answer answer;
  SImuConfig study;
  study.blocks = kCompleteSImuBlocks;
  add(answer,
      with_mounting(
          study, {{0, 1, 0, -1, 0, 0, 0, 0, 1}, {1, 2, 3}, 0.004, {5e-3, 6e-3, 7e-3}, {8e-3, 9e-3, 1e-2}}));
  test::expect_recorded("service/pipeline/known_mounting.txt", answer.text());
}

}  // namespace
}  // namespace imuscope
