#include "service/run/telemetry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <cmath>
#include <limits>

#include "publish/lcm_publisher.h"
#include "publish/message_codec.h"
#include "publish/message_values.h"

namespace imuscope {
namespace {

using testing::ElementsAre;

constexpr double kDegreesPerRadian = 57.29577951308232;  // 180 / pi
constexpr UtcTime kUtc = utc_time_from_ns(1'700'000'000'123'456'789);
constexpr std::int64_t kUtime = 1'700'000'000'123'456;
constexpr HostTime kFirst = host_time_from_ns(5'000'000'000);
constexpr HostTime kThen = host_time_from_ns(17'500'000'000);  // 12.5 s later
/// 2023-11-14, 18 leap seconds after the GPS epoch.
constexpr std::int32_t kLeap_s = 18;

TimeScale scale() {
  TimeScale s;
  s.source = UtcSource::kReference;
  s.time = kThen;
  s.utc = kUtc;
  s.gps_minus_utc_s = kLeap_s;
  return s;
}

/// What a receiver on the other side of the wire gets.
template <typename Message>
Message over_the_wire(const Message& message) {
  const auto received = decode_message<Message>(encode_message(message));
  EXPECT_TRUE(received);
  return received.value_or(Message{});
}

Snapshot snapshot() {
  Snapshot s{};
  s.first_reference_time = kFirst;
  s.n_studies = 2;
  s.time_scale = scale();
  return s;
}

TEST(Telemetry, NavigationArrivesInDegreesWithEveryFieldInItsPlace) {
  Snapshot s = snapshot();
  s.navigation.time = kThen;
  s.navigation.latitude_rad = 0.8;
  s.navigation.longitude_rad = 0.15;
  s.navigation.height_m = 432.1;
  s.navigation.v_n_mps = {11, 12, 13};
  s.navigation.rpy_rad = {0.1, -0.2, 3.0};
  s.navigation.sd_position_m = {0.01, 0.02, 0.03};
  s.navigation.sd_velocity_mps = {0.04, 0.05, 0.06};
  s.navigation.sd_rpy_rad = {0.07, 0.08, 0.09};
  const auto m = over_the_wire(navigation_message(s));
  EXPECT_EQ(m.utime, kUtime);
  EXPECT_EQ(m.time_s, 12.5);
  EXPECT_DOUBLE_EQ(m.lat_deg, 0.8 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.lon_deg, 0.15 * kDegreesPerRadian);
  EXPECT_EQ(m.height_m, 432.1);
  EXPECT_THAT((std::array{m.v_n_mps, m.v_e_mps, m.v_d_mps}), ElementsAre(11, 12, 13));
  EXPECT_DOUBLE_EQ(m.roll_deg, 0.1 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.pitch_deg, -0.2 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.heading_deg, 3.0 * kDegreesPerRadian);
  EXPECT_THAT((std::array{m.sd_n_m, m.sd_e_m, m.sd_d_m}), ElementsAre(0.01, 0.02, 0.03));
  EXPECT_THAT((std::array{m.sd_v_n_mps, m.sd_v_e_mps, m.sd_v_d_mps}), ElementsAre(0.04, 0.05, 0.06));
  EXPECT_DOUBLE_EQ(m.sd_roll_deg, 0.07 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.sd_pitch_deg, 0.08 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.sd_heading_deg, 0.09 * kDegreesPerRadian);
}

TEST(Telemetry, NavigationHasTheUtcOfTheScaleAndTheGpsTimeThatBelongsToIt) {
  Snapshot s = snapshot();
  s.time_scale.rate = -50e-6;  // the host's clock is fast: 3 s of it are 150 us less of UTC
  s.navigation.time = kThen + std::chrono::seconds(3);
  const auto m = navigation_message(s);
  EXPECT_EQ(m.utime, kUtime + 3'000'000 - 150);
  EXPECT_EQ(pose_message(s, s).utime, m.utime);
  // 1 700 000 003 s + 18 s - 315 964 800 s (1980-01-06) = 2288 weeks + 252 821 s, by hand.
  EXPECT_EQ(m.gps_week, 2288);
  EXPECT_NEAR(m.gps_tow_s, 252'821.123'306'789, 1e-6);
  s.time_scale = {};
  const auto unknown = navigation_message(s);
  EXPECT_EQ(unknown.utime, 0);
  EXPECT_TRUE(std::isnan(unknown.gps_tow_s));
}

TEST(Telemetry, MessagesSayHowOldTheirDataAreAndWhetherTheyMayBeUsed) {
  Snapshot s = snapshot();
  s.navigation.time = kThen;
  s.navigation.has_gnss = true;
  s.navigation.gnss_time = kThen - std::chrono::seconds(1);
  const auto at = [&](double after_s) {
    s.ages = data_ages(s.navigation, true, kThen + from_seconds(after_s));
    return over_the_wire(navigation_message(s));
  };
  EXPECT_EQ(at(0.02).validity, navigation_t::USABLE);
  EXPECT_DOUBLE_EQ(at(0.02).reference_age_s, 0.02);
  EXPECT_DOUBLE_EQ(at(0.02).gnss_age_s, 1.02);
  EXPECT_EQ(at(0.6).validity, navigation_t::STALE);
  s.navigation.gnss_contradicts = true;
  EXPECT_EQ(at(0.02).validity, navigation_t::CONTRADICTED);
  EXPECT_EQ(at(0.6).validity, navigation_t::STALE);
  s.navigation.gnss_contradicts = false;
  s.navigation.gnss_time = kThen - std::chrono::seconds(6);
  EXPECT_EQ(at(0.02).validity, navigation_t::COASTING);
  s.navigation.has_gnss = false;
  EXPECT_EQ(at(0.02).validity, navigation_t::COASTING);
  EXPECT_TRUE(std::isnan(at(0.02).gnss_age_s));
  s.ages = data_ages(s.navigation, false, kThen);
  EXPECT_EQ(navigation_message(s).validity, navigation_t::STALE);

  SImuOutput& study = s.studies[1];
  study.status = CalibrationStatus::kConverging;
  study.sd_psi_rad = {kUsableBoresightSd_rad, 0, 0};
  study.sd_r_bs_b_m = {0, kUsableLeverArmSd_m, 0};
  study.sd_t_d_s = kUsableTimeOffsetSd_s;
  s.ages = data_ages(s.navigation, true, kThen + from_seconds(0.02));
  const auto of_study = [&] { return over_the_wire(calibration_message(s, 1, "mtx2")).validity; };
  EXPECT_EQ(of_study(), calibration_t::USABLE);
  study.sd_r_bs_b_m[1] *= 1.01;
  EXPECT_EQ(of_study(), calibration_t::CONVERGING);
  study.contradicts = true;
  EXPECT_EQ(of_study(), calibration_t::CONTRADICTED);
  s.ages.reference_s = 0.6;
  EXPECT_EQ(of_study(), calibration_t::STALE);
}

TEST(Telemetry, OdometryArrivesInPercentAndDegreesWithEveryFieldInItsPlace) {
  Snapshot s = snapshot();
  OdometryOutput& o = s.odometry;
  o.time = kThen;
  o.speed_mps = 12.25;
  o.standing = o.resting = true;
  o.scale = 0.012;
  o.sd_scale = 0.003;
  o.mount_rad = {0.0, 0.01, 0.02};
  o.sd_mount_rad = {0.0, 0.03, 0.04};
  o.r_bv_b_m = {1, 2, 3};
  o.sd_r_bv_b_m = {4, 5, 6};
  o.nis = {0.7, 0.8, 0.9};
  s.counters.odometry_speed_used = 21;
  s.counters.odometry_speed_rejected = 22;
  s.counters.odometry_slip_used = 23;
  s.counters.odometry_slip_rejected = 24;
  s.counters.zero_velocity_used = 25;
  s.counters.zero_velocity_rejected = 26;
  const auto m = over_the_wire(odometry_message(s));
  EXPECT_EQ(m.utime, kUtime);
  EXPECT_EQ(m.time_s, 12.5);
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
  s.odometry.lost = true;
  s.odometry.resting = false;
  const auto lost = odometry_message(s);
  EXPECT_THAT((std::array<bool, 3>{lost.standing != 0, lost.zero_velocity != 0, lost.lost != 0}),
              ElementsAre(true, false, true));
}

/// A second S-IMU whose states count 1, 2, 3, ... through psi, r, gyro bias, accel bias, gyro scale, accel
/// scale, t_d, and their sd from 101 on.
Snapshot calibrated_snapshot() {
  Snapshot s = snapshot();
  SImuOutput& study = s.studies[1];
  study.status = CalibrationStatus::kConverging;
  study.time = kThen;
  study.C_b_s = {0, 1, 0, -1, 0, 0, 0, 0, 1};
  double next = 0.0;
  for (Vector3* vector : {&study.psi_rad, &study.r_bs_b_m, &study.gyro_bias_radps, &study.accel_bias_mps2,
                          &study.gyro_scale, &study.accel_scale}) {
    for (double& component : *vector) component = next += 1.0;
  }
  study.t_d_s = 19.0;
  next = 100.0;
  for (Vector3* vector : {&study.sd_psi_rad, &study.sd_r_bs_b_m, &study.sd_gyro_bias_radps,
                          &study.sd_accel_bias_mps2, &study.sd_gyro_scale, &study.sd_accel_scale}) {
    for (double& component : *vector) component = next += 1.0;
  }
  study.sd_t_d_s = 119.0;
  study.observable.fill(true);
  study.t_d_observable = true;
  study.weakest_direction = {0.0, 0.0, 1.0, 0.0, 0.0, 0.0};
  study.weakest_relative_sd = 0.25;
  return s;
}

TEST(Telemetry, TheStateOfThePcClockArrivesAndWhatTheKernelDoesNotTellIsNoNumber) {
  PcClockLog::News news;
  news.state.reading = {kThen, utc_time_from_ns(1'700'000'000'000'000'123), Duration{1}};
  news.step = WallClockStep{kThen - Duration{5}, kThen, -3600.0};
  const UtcTime utc = utc_time_from_ns(kUtime * 1000);
  auto m = over_the_wire(pc_clock_message(news, utc));
  EXPECT_EQ(m.utime, kUtime);
  EXPECT_EQ(m.host_ns, to_ns(kThen));
  EXPECT_EQ(m.wall_ns, 1'700'000'000'000'000'123);
  EXPECT_EQ(m.step_s, -3600.0);
  EXPECT_EQ(m.is_known, 0);
  EXPECT_TRUE(std::isnan(m.max_error_s));
  news.step.reset();
  news.state.kernel = KernelClockState{8193, true, 1e-4, -12.5, 0.02, 1e-3, 37};
  m = over_the_wire(pc_clock_message(news, utc));
  EXPECT_EQ(m.step_s, 0.0);
  EXPECT_EQ(m.is_known, 1);
  EXPECT_EQ(m.is_synchronised, 1);
  EXPECT_EQ(m.status, 8193);
  EXPECT_EQ((std::array<double, 4>{m.offset_s, m.frequency_ppm, m.max_error_s, m.estimated_error_s}),
            (std::array<double, 4>{1e-4, -12.5, 0.02, 1e-3}));
  EXPECT_EQ(m.tai_minus_utc_s, 37);
}

TEST(Telemetry, CalibrationArrivesWithEveryStateAndSdInItsPlace) {
  const auto m = over_the_wire(calibration_message(calibrated_snapshot(), 1, "mtx1"));
  EXPECT_EQ(m.utime, kUtime + 19'000'000) << "of the motion that the sample shows";
  EXPECT_EQ(m.name, "mtx1");
  EXPECT_EQ(m.time_s, 12.5);
  const double root = std::sqrt(0.5);
  EXPECT_NEAR(m.q_w, root, 1e-15);
  EXPECT_NEAR(std::abs(m.q_z), root, 1e-15);
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

TEST(Telemetry, AQuaternionHasNoNegativeScalar) {
  Snapshot s = snapshot();
  s.studies[0].C_b_s = {-1, 0, 0, 0, -1, 0, 0, 0, 1};  // half a turn about z
  EXPECT_GE(calibration_message(s, 0, "s").q_w, 0.0);
}

TEST(Telemetry, AStateThatIsNotObservableYetHasNoNumberButItsSd) {
  Snapshot s = calibrated_snapshot();
  s.studies[1].observable = {true, true, false, true, true, true};
  s.studies[1].t_d_observable = false;
  const auto m = over_the_wire(calibration_message(s, 1, "mtx1"));
  EXPECT_TRUE(std::isnan(m.psi_z_deg));
  EXPECT_TRUE(std::isnan(m.t_d_ms));
  EXPECT_THAT((std::array{m.psi_x_observable, m.psi_y_observable, m.psi_z_observable, m.r_x_observable,
                          m.r_y_observable, m.r_z_observable, m.t_d_observable}),
              ElementsAre(1, 1, 0, 1, 1, 1, 0));
  EXPECT_DOUBLE_EQ(m.psi_x_deg, 1 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.sd_psi_z_deg, 103 * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.goal_sd_psi_deg, kFinestGoal.boresight_sd_rad * kDegreesPerRadian);
  EXPECT_DOUBLE_EQ(m.goal_sd_r_m, kFinestGoal.lever_arm_sd_m);
  EXPECT_DOUBLE_EQ(m.goal_sd_t_d_ms, kFinestGoal.time_offset_sd_s * 1e3);
  EXPECT_EQ(m.weakest_direction, "boresight about down");
  EXPECT_DOUBLE_EQ(m.weakest_relative_sd, 0.25);
  EXPECT_THAT(m.advice, testing::HasSubstr("quickly"));
}

ErrorRecord error_record(double time_s) {
  ErrorRecord record{};
  record.first_reference_time = kFirst;
  record.row.time = kFirst + from_seconds(time_s);
  record.row.utc = scale().at(record.row.time);
  record.row.counter = 70'001;
  record.row.regime = Regime::kDynamic;
  record.row.e_gyro_radps = {1e-3, 2e-3, 3e-3};
  record.row.e_accel_mps2 = {0.1, 0.2, 0.3};
  record.row.gyro_valid = record.row.accel_valid = true;
  record.ages = {0.02, 0.3};
  return record;
}

TEST(Telemetry, ErrorRowsArriveWithTheirRegimeInWordsAndNoNumberWhereTheyHaveNone) {
  ErrorBatch batch("mtx2");
  EXPECT_FALSE(batch.take());
  ErrorRecord record = error_record(12.5);
  EXPECT_FALSE(batch.add(record));
  record.row.gyro_valid = false;
  record.ages = {0.03, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_FALSE(batch.add(record));
  record.row.accel_valid = false;
  EXPECT_FALSE(batch.add(record));
  const auto m = over_the_wire(batch.take().value());
  EXPECT_FALSE(batch.take());
  EXPECT_EQ(m.utime, kUtime);
  EXPECT_EQ(m.name, "mtx2");
  EXPECT_EQ(m.regime, "dynamic");
  EXPECT_EQ(m.validity, error_t::USABLE);
  EXPECT_EQ(m.reference_age_s, 0.03);
  EXPECT_EQ(m.gnss_age_s, 0.3);
  ASSERT_EQ(m.n_rows, 3);
  const error_row_t& row = m.rows[0];
  EXPECT_EQ(row.utime, kUtime);
  EXPECT_EQ(row.time_s, 12.5);
  EXPECT_EQ(row.counter, 70'001);
  EXPECT_THAT((std::array{row.e_gyro_x_radps, row.e_gyro_y_radps, row.e_gyro_z_radps}),
              ElementsAre(1e-3, 2e-3, 3e-3));
  EXPECT_THAT((std::array{row.e_accel_x_mps2, row.e_accel_y_mps2, row.e_accel_z_mps2}),
              ElementsAre(0.1, 0.2, 0.3));
  EXPECT_TRUE(std::isnan(m.rows[1].e_gyro_y_radps));
  EXPECT_EQ(m.rows[1].e_accel_y_mps2, 0.2);
  EXPECT_TRUE(std::isnan(m.rows[2].e_accel_z_mps2));
}

TEST(Telemetry, AMessageOfErrorRowsEndsWithItsTenthOfASecondItsRegimeAndItsValidity) {
  ErrorBatch batch("mtx2");
  std::vector<std::size_t> sizes;
  const auto add = [&](const ErrorRecord& record) {
    if (const auto m = batch.add(record)) sizes.push_back(m->rows.size());
  };
  for (int i = 0; i < 25; ++i) add(error_record(0.004 + 0.01 * i));  // 100 Hz: 10, 10 and 5
  EXPECT_THAT(sizes, ElementsAre(10, 10));
  ErrorRecord other = error_record(0.254);
  other.row.regime = Regime::kStatic;
  add(other);
  other.validity = Validity::kConverging;
  add(other);
  EXPECT_THAT(sizes, ElementsAre(10, 10, 5, 1));
  EXPECT_FALSE(batch.take_old(1.2)) << "a row of the same tenth may come yet";
  EXPECT_EQ(batch.take_old(1.5).value().rows.size(), 1U);
  // A tenth of a second at 2 kHz is one datagram, and what a stalled core hands out at once are several.
  sizes.clear();
  for (std::size_t i = 0; i <= 2 * ErrorBatch::kRowsMax; ++i) add(error_record(7.05));
  EXPECT_THAT(sizes, ElementsAre(ErrorBatch::kRowsMax, ErrorBatch::kRowsMax));
  const auto encoded = encode_message([&] {
    error_t m;
    m.rows.resize(ErrorBatch::kRowsMax);
    m.n_rows = element_count(m.rows);
    return m;
  }());
  EXPECT_LT(encoded.size(), kMaxMessageBytes);
}

/// Two axes: the second has a fit.
Refit refit() {
  Refit refit;
  refit.name = "mtx1";
  refit.time = kThen;
  refit.utc = scale().at(kThen);
  refit.first_reference_time = kFirst;
  AxisRefit without;
  without.axis = 0;
  without.regime = Regime::kStatic;
  without.rate_hz = 100.0;
  without.wv.n_valid = 6000;
  without.wv.levels.resize(2);
  without.wv.levels[0] = {1, 2.0, 1e-6, 0.9e-6, 1.2e-6, 5999};
  without.wv.levels[1] = {2, 4.0, 5e-7, 4e-7, 7e-7, 5997};
  AxisRefit with = without;
  with.axis = 5;
  with.regime = Regime::kDynamic;
  noise::FitResult fit;
  fit.n = 6000;
  fit.rate_hz = 100.0;
  fit.spec = *noise::parse_model("WN+GM");
  fit.parameters.push_back({"WN", "sigma2", "(m/s^2)^2", 1.0, 0.1, 0.8, 1.2, {}});
  fit.parameters.push_back({"GM1", "beta", "1/s", 0.5, {}, {}, {}, {}});
  fit.wv.push_back({without.wv.levels[0], 0.25, 0.0, 0.0});
  fit.objective = 3.5;
  fit.j_test = noise::JTest{4.5, 7, 0.72};
  fit.criterion = -2.5;
  fit.warnings = {"the slowest process is longer than the data"};
  with.fit = fit;
  with.change = noise::JTest{61.5, 9, 7e-10};
  with.changed = true;
  refit.axes = {without, with};
  return refit;
}

TEST(Telemetry, WaveletVariancesKeepTheirLevels) {
  const auto m = over_the_wire(wavelet_variance_message(refit()));
  EXPECT_EQ(m.utime, kUtime);
  EXPECT_EQ(m.name, "mtx1");
  EXPECT_EQ(m.time_s, 12.5);
  ASSERT_EQ(m.axes.size(), 2U);
  EXPECT_EQ(m.axes[1].axis + m.axes[1].regime + m.axes[1].unit, "accel_zdynamicm/s^2");
  const axis_wavelet_variance_t& axis = m.axes[0];
  EXPECT_EQ(axis.axis + axis.regime + axis.unit, "gyro_xstaticrad/s");
  EXPECT_EQ(axis.n, 6000);
  EXPECT_EQ(axis.rate_hz, 100.0);
  EXPECT_THAT(axis.level, ElementsAre(1, 2));
  EXPECT_THAT(axis.tau_s, ElementsAre(0.02, 0.04));
  EXPECT_THAT(axis.value, ElementsAre(1e-6, 5e-7));
  EXPECT_THAT(axis.ci_low, ElementsAre(0.9e-6, 4e-7));
  EXPECT_THAT(axis.ci_high, ElementsAre(1.2e-6, 7e-7));
  EXPECT_THAT(axis.n_coefficients, ElementsAre(5999, 5997));
}

TEST(Telemetry, NoiseModelsKeepTheirParametersAndWhatIsUnknown) {
  const auto m = over_the_wire(noise_model_message(refit()));
  ASSERT_EQ(m.models.size(), 1U) << "an axis without a fit has no model";
  const axis_noise_model_t& model = m.models[0];
  EXPECT_EQ(model.axis + model.regime + model.unit, "accel_zdynamicm/s^2");
  EXPECT_EQ(model.n, 6000);
  EXPECT_EQ(model.rate_hz, 100.0);
  EXPECT_EQ(model.model, "WN+GM");
  EXPECT_EQ(model.weights, "optimal");
  EXPECT_EQ(model.intervals, "quick");
  ASSERT_EQ(model.parameters.size(), 2U);
  EXPECT_EQ(model.parameters[0].process + model.parameters[0].name + model.parameters[0].unit,
            "WNsigma2(m/s^2)^2");
  EXPECT_THAT((std::array{model.parameters[0].value, model.parameters[0].sd, model.parameters[0].ci_low,
                          model.parameters[0].ci_high}),
              ElementsAre(1.0, 0.1, 0.8, 1.2));
  EXPECT_EQ(model.parameters[1].value, 0.5);
  EXPECT_TRUE(std::isnan(model.parameters[1].sd));
  EXPECT_TRUE(std::isnan(model.parameters[1].ci_low));
  EXPECT_TRUE(std::isnan(model.parameters[1].ci_high));
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

TEST(Telemetry, OneDegreeOfFreedomIsTakenAndNoneIsUnknown) {
  Refit one = refit();
  one.axes[1].change->dof = 1;
  EXPECT_EQ(noise_model_message(one).models[0].change_dof, 1.0);
  one.axes[1].change->dof = 0;
  EXPECT_TRUE(std::isnan(noise_model_message(one).models[0].change_dof));
}

TEST(Telemetry, TheFirstModelHasNothingToBeComparedWith) {
  Refit first = refit();
  first.axes[1].change.reset();
  first.axes[1].changed = false;
  first.axes[1].fit->j_test.reset();
  first.axes[1].fit->identifiable = false;
  first.axes[1].fit->weighting = noise::Weighting::kCi;
  first.axes[1].fit->intervals = noise::Intervals::kInverted;
  const auto message = noise_model_message(first);
  const axis_noise_model_t& model = message.models[0];
  for (const double unknown : {model.change_statistic, model.change_dof, model.change_p_value,
                               model.j_statistic, model.j_dof, model.j_p_value})
    EXPECT_TRUE(std::isnan(unknown));
  EXPECT_EQ(model.changed, 0);
  EXPECT_EQ(model.identifiable, 0);
  EXPECT_EQ(model.weights, "ci");
  EXPECT_EQ(model.intervals, "inverted");
}

TEST(Telemetry, DynamicsAreStampedLikeTheModels) {
  Refit with_motion = refit();
  with_motion.motion.n_static = 5;
  with_motion.motion.n_dynamic = 7;
  MotionFit& yaw = with_motion.motion.axes[2];
  yaw = {.mean = 1.0,
         .rms = 2.0,
         .largest = 3.0,
         .slope = 4.0,
         .slope_sd = 5.0,
         .correlation = 0.6,
         .r2 = 0.7,
         .f = 8.0,
         .p_value = 0.9};
  with_motion.motion.covariates[1] = {.mean = 11.0, .rms = 12.0, .largest = 13.0};
  const auto m = over_the_wire(dynamics_message(with_motion));
  EXPECT_EQ(m.utime, kUtime);
  EXPECT_EQ(m.name, "mtx1");
  EXPECT_EQ(m.time_s, 12.5);
  EXPECT_EQ(m.n_static, 5);
  EXPECT_EQ(m.n_dynamic, 7);
  ASSERT_EQ(m.axes.size(), kAxisCount);
  const axis_dynamics_t& axis = m.axes[2];
  EXPECT_EQ(axis.axis, "gyro_z");
  EXPECT_EQ(axis.unit, "rad/s");
  EXPECT_THAT((std::array{axis.mean, axis.rms, axis.largest, axis.slope, axis.slope_sd, axis.correlation,
                          axis.r2, axis.f, axis.p_value}),
              ElementsAre(1.0, 2.0, 3.0, 4.0, 5.0, 0.6, 0.7, 8.0, 0.9));
  EXPECT_TRUE(std::isnan(m.axes[0].slope)) << "nothing is known of it";
  ASSERT_EQ(m.covariates.size(), kCovariates);
  EXPECT_EQ(m.covariates[1].name, covariate_name(1));
  EXPECT_EQ(m.covariates[1].unit, covariate_unit(1));
  EXPECT_EQ(m.covariates[1].mean, 11.0);
  EXPECT_EQ(m.covariates[1].rms, 12.0);
  EXPECT_EQ(m.covariates[1].largest, 13.0);
  with_motion.motion.n_dynamic = 0;
  EXPECT_TRUE(dynamics_message(with_motion).covariates.empty()) << "there was no motion";
}

/// On the equator at longitude zero, nose to the east and level: n's axes are known by hand.
TEST(Bridge, IsForwardLeftUpInEastNorthUp) {
  Snapshot origin = snapshot();
  origin.navigation.time = kThen;
  Snapshot s = origin;
  s.navigation.height_m = 20.0;
  s.navigation.C_b_n = {0, -1, 0, 1, 0, 0, 0, 0, 1};  // forward is east, right is south
  s.navigation.v_n_mps = {0.0, 15.0, -2.0};           // to the east and up
  s.navigation.gyro_bias_radps = {0.1, 0.2, 0.3};
  s.navigation.accel_bias_mps2 = {0.5, 0.6, 0.7};
  s.reference.counter = 13;
  s.reference.omega_radps = {0.1, 0.2, 1.3};
  s.reference.f_mps2 = {1.5, 0.6, -9.1};
  const auto pose = over_the_wire(pose_message(s, origin));
  EXPECT_EQ(pose.utime, kUtime);
  EXPECT_NEAR(pose.pos[2], 20.0, 1e-3);
  EXPECT_THAT(pose.vel, ElementsAre(testing::DoubleNear(15.0, 1e-12), testing::DoubleNear(0.0, 1e-12),
                                    testing::DoubleNear(2.0, 1e-12)));
  // Forward-left-up and east-north-up are the same axes here.
  EXPECT_NEAR(std::abs(pose.orientation[0]), 1.0, 1e-12);
  // A turn to the right about down is one to the left about up, with the sign turned.
  EXPECT_NEAR(pose.rotation_rate[2], -1.0, 1e-4);
  EXPECT_NEAR(pose.accel[0], 1.0, 1e-9);
  EXPECT_NEAR(pose.accel[2], 9.8 - 9.78, 0.01) << "gravity is taken out";
  const auto ins = over_the_wire(ins_message(s, origin));
  EXPECT_EQ(ins.utime, kUtime);
  EXPECT_EQ(ins.device_time, 13);
  EXPECT_THAT(ins.gyro, ElementsAre(0.1, -0.2, -1.3)) << "as measured";
  EXPECT_THAT(ins.accel, ElementsAre(1.5, -0.6, 9.1));
  EXPECT_NEAR(std::abs(ins.quat[0]), 1.0, 1e-12);
  EXPECT_NEAR(ins.rel_alt, 20.0, 1e-3);
}

}  // namespace
}  // namespace imuscope
