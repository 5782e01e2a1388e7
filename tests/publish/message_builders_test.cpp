#include "publish/message_builders.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <cmath>
#include <fstream>
#include <regex>
#include <sstream>
#include <tuple>

#include "example_reports.h"
#include "publish/channel_name.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::ElementsAre;

constexpr double kDegreesPerRadian = 57.29577951308232;  // 180 / pi

/// What a receiver on the other side of the wire gets.
template <typename Message>
Message over_the_wire(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  EXPECT_EQ(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())), static_cast<int>(bytes.size()));
  Message received;
  EXPECT_EQ(received.decode(bytes.data(), 0, static_cast<int>(bytes.size())), static_cast<int>(bytes.size()));
  return received;
}

/// Names of the fields of one message type, read from its definition.
std::vector<std::string> fields_of(const std::string& type) {
  std::ifstream file(test::source_path("src/publish/lcm/" + type + ".lcm"));
  EXPECT_TRUE(file.is_open()) << type;
  std::vector<std::string> fields;
  const std::regex declaration(R"(^\s+(?:double|string|int64_t|boolean)\s+(\w+)\s*;.*)");
  for (std::string line; std::getline(file, line);) {
    std::smatch match;
    if (std::regex_match(line, match, declaration)) fields.push_back(match[1]);
  }
  return fields;
}

std::vector<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

TEST(MessageTypes, FieldsAreThoseOfTheFilesOfARun) {
  EXPECT_EQ(
      fields_of("navigation_t"),
      words("utime sequence time_s lat_deg lon_deg height_m v_n_mps v_e_mps v_d_mps roll_deg pitch_deg "
            "heading_deg sd_n_m sd_e_m sd_d_m sd_v_n_mps sd_v_e_mps sd_v_d_mps sd_roll_deg sd_pitch_deg "
            "sd_heading_deg"));
  EXPECT_EQ(fields_of("error_t"),
            words("utime sequence name time_s counter e_gyro_x_radps e_gyro_y_radps e_gyro_z_radps "
                  "e_accel_x_mps2 e_accel_y_mps2 e_accel_z_mps2 regime"));
  EXPECT_EQ(
      fields_of("calibration_t"),
      words("utime sequence name time_s psi_x_deg psi_y_deg psi_z_deg q_w q_x q_y q_z r_x_m r_y_m r_z_m "
            "t_d_ms bg_x_radps bg_y_radps bg_z_radps ba_x_mps2 ba_y_mps2 ba_z_mps2 sg_x sg_y sg_z sa_x "
            "sa_y sa_z sd_psi_x_deg sd_psi_y_deg sd_psi_z_deg sd_r_x_m sd_r_y_m sd_r_z_m sd_t_d_ms "
            "sd_bg_x_radps sd_bg_y_radps sd_bg_z_radps sd_ba_x_mps2 sd_ba_y_mps2 sd_ba_z_mps2 sd_sg_x "
            "sd_sg_y sd_sg_z sd_sa_x sd_sa_y sd_sa_z psi_x_observable psi_y_observable psi_z_observable "
            "r_x_observable r_y_observable r_z_observable t_d_observable goal_sd_psi_deg goal_sd_r_m "
            "goal_sd_t_d_ms weakest_direction weakest_relative_sd advice"));
}

TEST(MessageBuilders, UtimeIsWholeMicrosecondsRoundedDown) {
  EXPECT_EQ(to_utime(utc_time_from_ns(1'700'000'000'123'456'789)), 1'700'000'000'123'456);
  EXPECT_EQ(to_utime(utc_time_from_ns(999)), 0);
  EXPECT_EQ(to_utime(utc_time_from_ns(-1)), -1);
}

TEST(MessageBuilders, NavigationArrivesInDegreesWithEveryFieldInItsPlace) {
  const navigation_t message = over_the_wire(to_message(test::example_navigation(), 41));
  EXPECT_EQ(message.utime, 1'700'000'000'123'456);
  EXPECT_EQ(message.sequence, 41);
  EXPECT_EQ(message.time_s, 3.25);
  EXPECT_DOUBLE_EQ(message.lat_deg, 0.8 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(message.lon_deg, 0.15 * kDegreesPerRadian);
  EXPECT_EQ(message.height_m, 432.1);
  EXPECT_THAT((std::array{message.v_n_mps, message.v_e_mps, message.v_d_mps}), ElementsAre(11, 12, 13));
  EXPECT_DOUBLE_EQ(message.roll_deg, 0.1 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(message.pitch_deg, -0.2 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(message.heading_deg, 3.0 * kDegreesPerRadian);
  EXPECT_THAT((std::array{message.sd_n_m, message.sd_e_m, message.sd_d_m}), ElementsAre(0.01, 0.02, 0.03));
  EXPECT_THAT((std::array{message.sd_v_n_mps, message.sd_v_e_mps, message.sd_v_d_mps}),
              ElementsAre(0.04, 0.05, 0.06));
  EXPECT_DOUBLE_EQ(message.sd_roll_deg, 0.07 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(message.sd_pitch_deg, 0.08 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(message.sd_heading_deg, 0.09 * kDegreesPerRadian);
}

TEST(MessageBuilders, OdometryArrivesInPercentAndDegreesWithEveryFieldInItsPlace) {
  const odometry_t m = over_the_wire(to_message(test::example_odometry(), 42));
  EXPECT_EQ(m.utime, 1'700'000'000'123'456);
  EXPECT_EQ(m.sequence, 42);
  EXPECT_EQ(m.time_s, 4.75);
  EXPECT_EQ(m.speed_mps, 12.25);
  EXPECT_THAT((std::array<bool, 3>{m.standing != 0, m.zero_velocity != 0, m.lost != 0}),
              ElementsAre(true, true, false));
  EXPECT_DOUBLE_EQ(m.scale_percent, 1.2);
  EXPECT_DOUBLE_EQ(m.sd_scale_percent, 0.3);
  EXPECT_DOUBLE_EQ(m.mount_y_deg, 0.01 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.mount_z_deg, 0.02 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.sd_mount_y_deg, 0.03 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.sd_mount_z_deg, 0.04 * kDegreesPerRadian);
  EXPECT_THAT((std::array{m.axle_x_m, m.axle_y_m, m.axle_z_m, m.sd_axle_x_m, m.sd_axle_y_m, m.sd_axle_z_m}),
              ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT((std::array{m.nis_speed, m.nis_sideways, m.nis_upwards}), ElementsAre(0.7, 0.8, 0.9));
  EXPECT_THAT((std::array{m.speed_used, m.speed_rejected, m.non_holonomic_used, m.non_holonomic_rejected,
                          m.zero_velocity_used, m.zero_velocity_rejected}),
              ElementsAre(21, 22, 23, 24, 25, 26));
}

TEST(MessageBuilders, CalibrationArrivesWithEveryStateAndSdInItsPlace) {
  const calibration_t m = over_the_wire(to_message(test::example_calibration(), "mtx1", 5));
  EXPECT_EQ(m.name, "mtx1");
  EXPECT_EQ(m.sequence, 5);
  EXPECT_EQ(m.time_s, 12.5);
  EXPECT_THAT((std::array{m.q_w, m.q_x, m.q_y, m.q_z}), ElementsAre(0.5, -0.5, 0.1, 0.7));
  // The example counts 1, 2, 3, ... through psi, r, gyro bias, accel bias, gyro scale, accel scale, t_d.
  EXPECT_DOUBLE_EQ(m.psi_x_deg, 1 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.psi_y_deg, 2 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.psi_z_deg, 3 * kDegreesPerRadian);
  EXPECT_THAT((std::array{m.r_x_m, m.r_y_m, m.r_z_m, m.bg_x_radps, m.bg_y_radps, m.bg_z_radps, m.ba_x_mps2,
                          m.ba_y_mps2, m.ba_z_mps2, m.sg_x, m.sg_y, m.sg_z, m.sa_x, m.sa_y, m.sa_z}),
              ElementsAre(4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18));
  EXPECT_DOUBLE_EQ(m.t_d_ms, 19'000);
  EXPECT_DOUBLE_EQ(m.sd_psi_x_deg, 101 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.sd_psi_y_deg, 102 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.sd_psi_z_deg, 103 * kDegreesPerRadian);
  EXPECT_THAT((std::array{m.sd_r_x_m, m.sd_r_y_m, m.sd_r_z_m, m.sd_bg_x_radps, m.sd_bg_y_radps,
                          m.sd_bg_z_radps, m.sd_ba_x_mps2, m.sd_ba_y_mps2, m.sd_ba_z_mps2, m.sd_sg_x,
                          m.sd_sg_y, m.sd_sg_z, m.sd_sa_x, m.sd_sa_y, m.sd_sa_z}),
              ElementsAre(104, 105, 106, 107, 108, 109, 110, 111, 112, 113, 114, 115, 116, 117, 118));
  EXPECT_DOUBLE_EQ(m.sd_t_d_ms, 119'000);
}

TEST(MessageBuilders, AStateThatIsNotObservableYetHasNoNumberButItsSd) {
  CalibrationReport report = test::example_calibration();
  report.observable = {true, true, false, true, true, true, false};
  const calibration_t m = over_the_wire(to_message(report, "mtx1", 5));
  EXPECT_TRUE(std::isnan(m.psi_z_deg));
  EXPECT_TRUE(std::isnan(m.t_d_ms));
  EXPECT_FALSE(m.psi_z_observable);
  EXPECT_FALSE(m.t_d_observable);
  EXPECT_DOUBLE_EQ(m.psi_x_deg, 1 * kDegreesPerRadian);
  EXPECT_TRUE(m.psi_x_observable);
  EXPECT_DOUBLE_EQ(m.sd_psi_z_deg, 103 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.goal_sd_psi_deg, 2e-4 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.goal_sd_r_m, 1e-3);
  EXPECT_DOUBLE_EQ(m.goal_sd_t_d_ms, 0.1);
  EXPECT_EQ(m.weakest_direction, "boresight about down");
  EXPECT_DOUBLE_EQ(m.weakest_relative_sd, 0.25);
  EXPECT_EQ(m.advice, "brake firmly");
}

TEST(MessageBuilders, ErrorRowArrivesWithItsRegimeInWords) {
  const error_t m = over_the_wire(to_message(test::example_error(), "mtx2", 9));
  EXPECT_EQ(m.name, "mtx2");
  EXPECT_EQ(m.counter, 70'001);
  EXPECT_EQ(m.regime, "dynamic");
  EXPECT_THAT((std::array{m.e_gyro_x_radps, m.e_gyro_y_radps, m.e_gyro_z_radps}),
              ElementsAre(1e-3, 2e-3, 3e-3));
  EXPECT_THAT((std::array{m.e_accel_x_mps2, m.e_accel_y_mps2, m.e_accel_z_mps2}), ElementsAre(0.1, 0.2, 0.3));
}

TEST(MessageBuilders, WaveletVarianceKeepsItsLevels) {
  const wavelet_variance_t m = over_the_wire(to_message(test::example_wavelet_variance(), 1));
  EXPECT_EQ(m.name, "mtx1");
  ASSERT_EQ(m.axes.size(), 2U);
  const axis_wavelet_variance_t& axis = m.axes[1];
  EXPECT_EQ(axis.axis, "gyro_x");
  EXPECT_EQ(axis.unit, "rad/s");
  EXPECT_THAT(axis.level, ElementsAre(1, 2));
  EXPECT_THAT(axis.tau_s, ElementsAre(0.02, 0.04));
  EXPECT_THAT(axis.value, ElementsAre(1e-6, 5e-7));
  EXPECT_THAT(axis.ci_low, ElementsAre(0.9e-6, 4e-7));
  EXPECT_THAT(axis.ci_high, ElementsAre(1.2e-6, 7e-7));
  EXPECT_THAT(axis.n_coefficients, ElementsAre(5999, 5997));
}

TEST(MessageBuilders, NoiseModelKeepsItsParametersAndWhatIsUnknown) {
  const noise_model_t m = over_the_wire(to_message(test::example_noise_model(), 1));
  ASSERT_EQ(m.models.size(), 1U);
  const axis_noise_model_t& model = m.models[0];
  EXPECT_EQ(model.model, "WN+GM");
  ASSERT_EQ(model.parameters.size(), 2U);
  EXPECT_EQ(model.parameters[0].process, "WN");
  EXPECT_EQ(model.parameters[0].ci_high, 1.2);
  EXPECT_EQ(model.parameters[1].value, 0.5);
  EXPECT_TRUE(std::isnan(model.parameters[1].sd));
  EXPECT_THAT(model.tau_s, ElementsAre(0.02));
  EXPECT_THAT(model.fitted, ElementsAre(0.25));
  EXPECT_THAT((std::array{model.objective, model.j_statistic, model.j_dof, model.j_p_value, model.criterion}),
              ElementsAre(3.5, 4.5, 7, 0.72, -2.5));
  EXPECT_THAT((std::array{model.change_statistic, model.change_dof, model.change_p_value}),
              ElementsAre(61.5, 9.0, 7e-10));
  EXPECT_EQ(model.changed, 1);
  EXPECT_EQ(model.identifiable, 1);
  EXPECT_THAT(model.warnings, ElementsAre("the slowest process is longer than the data"));
}

TEST(MessageBuilders, StatusKeepsDevicesThreadsRingsAndProblems) {
  const status_t m = over_the_wire(to_message(test::example_status(), 1));
  EXPECT_EQ(m.state, "degraded");
  EXPECT_EQ(m.reason, "mtx2 is silent");
  EXPECT_DOUBLE_EQ(m.resident_memory_mb, 41.0);
  ASSERT_EQ(m.devices.size(), 2U);
  const device_status_t& device = m.devices[1];
  EXPECT_THAT(
      (std::array{device.bytes, device.bytes_skipped, device.frames, device.bad_checksums, device.samples,
                  device.samples_lost, device.samples_late, device.samples_refused, device.clock_resets}),
      ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_DOUBLE_EQ(device.latency_ms, 4.2);
  EXPECT_DOUBLE_EQ(device.clock_sd_us, 25.0);
  ASSERT_EQ(m.threads.size(), 1U);
  EXPECT_THAT((std::array{m.threads[0].ticks, m.threads[0].overruns, m.threads[0].skipped}),
              ElementsAre(10, 11, 12));
  EXPECT_DOUBLE_EQ(m.threads[0].lateness_p50_us, 13);
  EXPECT_DOUBLE_EQ(m.threads[0].lateness_p99_us, 14);
  EXPECT_DOUBLE_EQ(m.threads[0].lateness_p999_us, 15);
  EXPECT_DOUBLE_EQ(m.threads[0].lateness_max_us, 16);
  EXPECT_DOUBLE_EQ(m.threads[0].cpu_percent, 0.4);
  EXPECT_DOUBLE_EQ(m.threads[0].done_p50_us, 17);
  EXPECT_DOUBLE_EQ(m.threads[0].done_p99_us, 18);
  EXPECT_DOUBLE_EQ(m.threads[0].done_p999_us, 19);
  EXPECT_DOUBLE_EQ(m.threads[0].done_max_us, 20);
  EXPECT_THAT(m.threads[0].lateness_octaves, ElementsAre(1, 0, 9));
  EXPECT_EQ(m.build, "g++ 12");
  EXPECT_EQ(m.configuration_hash, "abc");
  EXPECT_EQ(m.refit_utime, to_utime(test::kExampleUtc));
  EXPECT_EQ(m.last_event, "roundabout");
  ASSERT_EQ(m.rings.size(), 1U);
  EXPECT_THAT((std::array{m.rings[0].capacity, m.rings[0].level, m.rings[0].high_water, m.rings[0].refused}),
              ElementsAre(1024, 17, 18, 19));
  EXPECT_THAT(m.problems, ElementsAre("no route; run ip route add"));
}

TEST(MessageBuilders, StatusKeepsHowFarEachCalibrationHasCome) {
  const status_t m = over_the_wire(to_message(test::example_status(), 1));
  ASSERT_EQ(m.studies.size(), 1U);
  const study_status_t& study = m.studies[0];
  EXPECT_EQ(study.name + study.state + study.regime + study.weakest + study.manoeuvre,
            "mtx1convergingdynamicpsi_zbrake");
  EXPECT_DOUBLE_EQ(study.sd_psi_deg, 0.01 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(study.goal_psi_deg, 0.001 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(study.sd_r_m, 0.02);
  EXPECT_DOUBLE_EQ(study.goal_r_m, 0.002);
  EXPECT_DOUBLE_EQ(study.sd_t_d_ms, 3.0);
  EXPECT_DOUBLE_EQ(study.goal_t_d_ms, 0.3);
  EXPECT_DOUBLE_EQ(study.weakest_relative, 0.5);
  EXPECT_THAT((std::array{study.samples, study.used, study.late, study.gated}), ElementsAre(21, 22, 23, 24));
}

TEST(MessageBuilders, AStatusBeforeTheFirstRefitSaysSoByAZeroTime) {
  EXPECT_EQ(to_message(StatusReport{}, 0).refit_utime, 0);
}

TEST(MessageBuilders, DynamicsKeepEveryAxis) {
  DynamicsReport report{test::kExampleUtc, 61.0, "mtx1", 5, 7, {}};
  report.axes.push_back({"gyro_x", "rad/s", 1.0, 2.0, 3.0, 4.0, 5.0, 0.6, 0.7, 8.0, 0.09});
  report.covariates.push_back({"omega_x", "rad/s", 10.0, 11.0, 12.0});
  const dynamics_t m = over_the_wire(to_message(report, 9));
  EXPECT_EQ(m.sequence, 9);
  EXPECT_EQ(m.name, "mtx1");
  EXPECT_EQ(m.n_static, 5);
  EXPECT_EQ(m.n_dynamic, 7);
  ASSERT_EQ(m.axes.size(), 1U);
  const auto& a = m.axes[0];
  EXPECT_EQ(a.axis + " " + a.unit, "gyro_x rad/s");
  EXPECT_THAT((std::array{a.mean, a.rms, a.largest, a.slope, a.slope_sd, a.correlation}),
              ElementsAre(1.0, 2.0, 3.0, 4.0, 5.0, 0.6));
  EXPECT_THAT((std::array{a.r2, a.f, a.p_value}), ElementsAre(0.7, 8.0, 0.09));
  ASSERT_EQ(m.covariates.size(), 1U);
  const auto& c = m.covariates[0];
  EXPECT_EQ(c.name + " " + c.unit, "omega_x rad/s");
  EXPECT_THAT((std::array{c.mean, c.rms, c.largest}), ElementsAre(10.0, 11.0, 12.0));
}

TEST(MessageBuilders, AnEventKeepsWhoSentItAndWhat) {
  const event_t m = over_the_wire(to_message(PersonEvent{test::kExampleUtc, "top on pc", "kerb"}, 3));
  EXPECT_EQ(m.utime, to_utime(test::kExampleUtc));
  EXPECT_EQ(m.sequence, 3);
  EXPECT_EQ(m.source, "top on pc");
  EXPECT_EQ(m.text, "kerb");
}

/// A fingerprint as LCM's documentation defines it, from the fields of libbot's types (package and name of a
/// type do not enter it).
std::int64_t fingerprint(const std::vector<std::tuple<std::string, std::string, int>>& fields) {
  std::int64_t v = 0x12345678;
  const auto update = [&](int c) {
    v = static_cast<std::int64_t>(
        ((static_cast<std::uint64_t>(v) << 8U) ^ static_cast<std::uint64_t>(v >> 55)) +
        static_cast<std::uint64_t>(static_cast<std::int64_t>(c)));
  };
  const auto update_string = [&](const std::string& s) {
    update(static_cast<int>(s.size()));
    for (const char c : s) update(c);
  };
  for (const auto& [name, type, size] : fields) {
    update_string(name);
    update_string(type);
    update(size > 0 ? 1 : 0);  // number of dimensions
    if (size == 0) continue;
    update(0);  // a constant size
    update_string(std::to_string(size));
  }
  const auto u = static_cast<std::uint64_t>(v);
  return static_cast<std::int64_t>((u << 1U) + ((u >> 63U) & 1U));
}

TEST(Bridge, HasTheFingerprintsOfLibbotsTypes) {
  EXPECT_EQ(pose_t::getHash(), fingerprint({{"utime", "int64_t", 0},
                                            {"pos", "double", 3},
                                            {"vel", "double", 3},
                                            {"orientation", "double", 4},
                                            {"rotation_rate", "double", 3},
                                            {"accel", "double", 3}}));
  EXPECT_EQ(ins_t::getHash(), fingerprint({{"utime", "int64_t", 0},
                                           {"device_time", "int64_t", 0},
                                           {"gyro", "double", 3},
                                           {"mag", "double", 3},
                                           {"accel", "double", 3},
                                           {"quat", "double", 4},
                                           {"pressure", "double", 0},
                                           {"rel_alt", "double", 0}}));
}

TEST(Bridge, KeepsEveryFieldInItsPlace) {
  BridgeReport report;
  report.utc = test::kExampleUtc;
  report.position_l_m = {1, 2, 3};
  report.velocity_b_mps = {4, 5, 6};
  report.q_b_l = {0.5, -0.5, 0.5, -0.5};
  report.rate_lb_b_radps = {7, 8, 9};
  report.acceleration_b_mps2 = {10, 11, 12};
  report.counter = 13;
  report.measured_omega_b_radps = {14, 15, 16};
  report.measured_f_b_mps2 = {17, 18, 19};
  const pose_t pose = over_the_wire(to_pose(report));
  EXPECT_EQ(pose.utime, to_utime(test::kExampleUtc));
  EXPECT_THAT(pose.pos, ElementsAre(1, 2, 3));
  EXPECT_THAT(pose.vel, ElementsAre(4, 5, 6));
  EXPECT_THAT(pose.orientation, ElementsAre(0.5, -0.5, 0.5, -0.5));
  EXPECT_THAT(pose.rotation_rate, ElementsAre(7, 8, 9));
  EXPECT_THAT(pose.accel, ElementsAre(10, 11, 12));
  const ins_t ins = over_the_wire(to_ins(report));
  EXPECT_EQ(ins.device_time, 13);
  EXPECT_THAT(ins.gyro, ElementsAre(14, 15, 16));
  EXPECT_THAT(ins.accel, ElementsAre(17, 18, 19));
  EXPECT_THAT(ins.quat, ElementsAre(0.5, -0.5, 0.5, -0.5));
  EXPECT_DOUBLE_EQ(ins.rel_alt, 3.0);
}

TEST(ChannelName, IsUpperCaseWithUnderscores) {
  EXPECT_EQ(channel_name("IMUSCOPE", "STATUS"), "IMUSCOPE_STATUS");
  EXPECT_EQ(channel_name("CAR2", "ERROR", "mtx-1"), "CAR2_ERROR_MTX_1");
  EXPECT_EQ(channel_name("IMUSCOPE", "RAW", std::string(100, 'x')).size(), 63U);
}

}  // namespace
}  // namespace imuscope
