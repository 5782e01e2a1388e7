/// What is taken of a ULog of PX4, old and new, whole, cut, with holes and with lies.

#include "logs/flight_log/ulog_reader.h"

#include <cmath>

#include "logs.h"
#include "tests/support/messages_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::flight_log {
namespace {

std::string message(char kind, const std::string& content) {
  Bytes head;
  head << static_cast<std::uint16_t>(content.size()) << kind;
  return head.text + content;
}
std::string ulog_begin(std::uint8_t incompatible = 0, std::uint64_t appended = 0) {
  Bytes head;
  for (const std::uint8_t byte : kUlogMagic) head << byte;
  head << std::uint8_t{1} << std::uint64_t{0};
  Bytes flags;
  flags << std::uint64_t{0} << static_cast<std::uint64_t>(incompatible) << appended << std::uint64_t{0}
        << std::uint64_t{0};
  return head.text + message('B', flags.text);
}
std::string format(const std::string& text) { return message('F', text); }
std::string subscription(std::uint8_t instance, std::uint16_t id, const std::string& name) {
  Bytes content;
  content << instance << id;
  return message('A', content.text + name);
}
std::string data(std::uint16_t id, const Bytes& fields) {
  Bytes content;
  content << id;
  return message('D', content.text + fields.text);
}
std::string synchronisation() { return message('S', std::string("\x2F\x73\x13\x20\x25\x0C\xBB\x12", 8)); }

const std::string kCombined = format(
    "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;int32_t "
    "accelerometer_timestamp_relative;float[3] accelerometer_m_s2;uint32_t "
    "accelerometer_integral_dt;uint8_t accelerometer_clipping;uint8_t[3] _padding0;");
const std::string kVehicleImu = format(
    "vehicle_imu:uint64_t timestamp;uint64_t timestamp_sample;uint32_t accel_device_id;uint32_t "
    "gyro_device_id;float[3] delta_angle;float[3] delta_velocity;uint16_t delta_angle_dt;uint16_t "
    "delta_velocity_dt;uint8_t delta_velocity_clipping;uint8_t[3] _padding0;");

Bytes combined(std::uint64_t us, float x, std::int32_t later_us = 0) {
  Bytes fields;
  fields << us << x << 2.0F << 3.0F << std::uint32_t{4000} << later_us << 4.0F << 5.0F << -9.5F
         << std::uint32_t{4000} << std::uint8_t{0};  // what pads a record need not be logged
  return fields;
}

TEST(Ulog, CombinedSensorsAreMeansOfTheirSpan) {
  const auto taken =
      take<UlogReader>(ulog_begin() + kCombined + subscription(0, 7, "sensor_combined") +
                       data(7, combined(1'000'000, 1.0F)) + data(7, combined(1'004'000, 1.5F, 2147483647)));
  ASSERT_EQ(taken.imus.size(), 2U) << taken.error;
  const auto& [topic, imu] = taken.imus[0];
  EXPECT_EQ(topic, "sensor_combined/0");
  EXPECT_EQ(imu.header.stamp_ns, 998'000'000) << "the middle of four milliseconds before 1 s";
  EXPECT_EQ(imu.angular_velocity, (mcap::Vector{1, 2, 3}));
  EXPECT_EQ(imu.linear_acceleration, (mcap::Vector{4, 5, -9.5}));
  EXPECT_EQ(taken.imus[1].second.linear_acceleration_covariance[0], mcap::kNotMeasured);
  EXPECT_TRUE(taken.losses.empty());
}

TEST(Ulog, AccelerometersThatAreLaterAreTold) {
  std::string log = ulog_begin() + kCombined + subscription(0, 7, "sensor_combined");
  for (std::uint64_t k = 1; k < 10; ++k) log += data(7, combined(k * 4000, 0.0F, -2000));
  const auto taken = take<UlogReader>(log);
  EXPECT_TRUE(taken.says("-2.0 ms")) << (taken.losses.empty() ? "nothing" : taken.losses[0]);
}

TEST(Ulog, SpansOfTheFirstLogsAreSeconds) {
  Bytes fields;
  fields << std::uint64_t{1'000'000} << 1.0F << 2.0F << 3.0F << 0.004F << std::int32_t{0} << 4.0F << 5.0F
         << 6.0F << 0.004F;
  const auto taken = take<UlogReader>(
      ulog_begin() +
      format(
          "sensor_combined:uint64_t timestamp;float[3] gyro_rad;float gyro_integral_dt;int32_t "
          "accelerometer_timestamp_relative;float[3] accelerometer_m_s2;float accelerometer_integral_dt;") +
      subscription(0, 1, "sensor_combined") + data(1, fields));
  ASSERT_EQ(taken.imus.size(), 1U);
  EXPECT_NEAR(static_cast<double>(taken.imus[0].second.header.stamp_ns), 998e6, 1.0);
}

TEST(Ulog, IncrementsOfEveryInstanceAreRates) {
  std::string log =
      ulog_begin() + kVehicleImu + subscription(0, 3, "vehicle_imu") + subscription(1, 4, "vehicle_imu");
  for (const std::uint16_t id : {std::uint16_t{3}, std::uint16_t{4}}) {
    Bytes fields;
    fields << std::uint64_t{2'000'500} << std::uint64_t{2'000'000} << std::uint32_t{1} << std::uint32_t{2}
           << 0.005F * static_cast<float>(id) << 0.0F << -0.01F << 0.0F << 0.05F << -0.049F
           << std::uint16_t{5000} << std::uint16_t{5000} << std::uint8_t{0};
    log += data(id, fields);
  }
  const auto taken = take<UlogReader>(log);
  ASSERT_EQ(taken.imus.size(), 2U);
  EXPECT_EQ(taken.imus[0].first, "vehicle_imu/0");
  EXPECT_EQ(taken.imus[1].first, "vehicle_imu/1");
  EXPECT_EQ(taken.imus[0].second.header.stamp_ns, 1'997'500'000);
  EXPECT_NEAR(taken.imus[0].second.angular_velocity[0], 3.0, 1e-6);
  EXPECT_NEAR(taken.imus[1].second.angular_velocity[0], 4.0, 1e-6);
  EXPECT_NEAR(taken.imus[1].second.linear_acceleration[1], 10.0, 1e-6);
  EXPECT_NEAR(taken.imus[1].second.linear_acceleration[2], -9.8, 1e-6);
}

/// Positions in 1e-7 degrees and millimetres once, in degrees and metres now.
TEST(Ulog, PositionsOldAndNewWithTheirVelocityAndUtc) {
  Bytes old;
  old << std::uint64_t{5'000'000} << std::uint64_t{1'700'000'000'123'456} << std::int32_t{473'977'419}
      << std::int32_t{-1'218'000'000} << std::int32_t{500'000} << std::int32_t{548'250} << 0.3F << 1.0F
      << 0.2F << 1.0F << -2.0F << 0.5F << std::int32_t{-100'000} << std::uint8_t{6} << std::uint8_t{1};
  const std::string rest =
      "float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;int32_t "
      "timestamp_time_relative;uint8_t fix_type;bool vel_ned_valid;";
  Bytes fresh;
  fresh << std::uint64_t{5'200'000} << std::uint64_t{0} << 47.3977419 << -121.8 << 500.0 << 548.25 << 0.3F
        << 1.0F << 0.2F << 1.0F << -2.0F << 0.5F << std::int32_t{0} << std::uint8_t{2} << std::uint8_t{0};
  const auto taken = take<UlogReader>(
      ulog_begin() +
      format("vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t "
             "alt;int32_t alt_ellipsoid;" +
             rest) +
      format("sensor_gps:uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;"
             "double altitude_msl_m;double altitude_ellipsoid_m;" +
             rest) +
      subscription(0, 1, "vehicle_gps_position") + subscription(0, 2, "sensor_gps") + data(1, old) +
      data(2, fresh));
  ASSERT_EQ(taken.fixes.size(), 2U);
  const auto& [topic, fix] = taken.fixes[0];
  EXPECT_EQ(topic, "vehicle_gps_position/0");
  EXPECT_EQ(fix.header.stamp_ns, 5'000'000'000);
  EXPECT_NEAR(fix.latitude_deg, 47.3977419, 1e-9);
  EXPECT_NEAR(fix.longitude_deg, -121.8, 1e-9);
  EXPECT_NEAR(fix.altitude_m, 548.25, 1e-9) << "above the ellipsoid";
  EXPECT_EQ(fix.status, 2);
  EXPECT_NEAR(std::sqrt(fix.position_covariance[0]), 1.0 / std::sqrt(2.0), 1e-6);
  EXPECT_NEAR(std::sqrt(fix.position_covariance[8]), 0.2, 1e-6);
  EXPECT_NEAR(taken.fixes[1].second.latitude_deg, fix.latitude_deg, 1e-9);
  EXPECT_NEAR(taken.fixes[1].second.altitude_m, fix.altitude_m, 1e-9);
  EXPECT_EQ(taken.fixes[1].second.status, -1) << "two dimensions are no height";
  ASSERT_EQ(taken.velocities.size(), 1U) << "one that is not valid is none";
  EXPECT_EQ(taken.velocities[0].first, "vehicle_gps_position/0/velocity");
  EXPECT_EQ(taken.velocities[0].second.linear_mps, (mcap::Vector{-2.0, 1.0, -0.5})) << "east, north, up";
  ASSERT_EQ(taken.times.size(), 1U) << "a receiver that knows no time says zero";
  EXPECT_EQ(taken.times[0].second.header.stamp_ns, 4'900'000'000);
  EXPECT_EQ(taken.times[0].second.time_ref_ns, 1'700'000'000'123'456'000);
}

TEST(Ulog, DropoutsAreSaid) {
  Bytes dropout;
  dropout << std::uint16_t{250};
  const auto taken = take<UlogReader>(ulog_begin() + kCombined + subscription(0, 7, "sensor_combined") +
                                      data(7, combined(4000, 1.0F)) + message('O', dropout.text) +
                                      message('O', dropout.text) + data(7, combined(600'000, 1.0F)));
  EXPECT_EQ(taken.imus.size(), 2U);
  EXPECT_TRUE(taken.says("dropped data 2 times, 0.5 s")) << taken.losses.size();
}

std::string long_ulog(int n) {
  std::string log = ulog_begin() + kCombined + subscription(0, 7, "sensor_combined");
  for (int k = 0; k < n; ++k) {
    if (k % 10 == 0) log += synchronisation();
    log += data(7, combined(static_cast<std::uint64_t>(k + 1) * 4000, static_cast<float>(k)));
  }
  return log;
}

TEST(Ulog, OfACutLogWhatStandsBeforeTheCutIsUsed) {
  const std::string log = long_ulog(50);
  const auto whole = take<UlogReader>(log);
  ASSERT_EQ(whole.imus.size(), 50U);
  for (std::size_t size = 16; size < log.size(); size += 7) {
    const auto taken = take<UlogReader>(log.substr(0, size));
    ASSERT_TRUE(taken.error.empty());
    for (std::size_t i = 0; i < taken.imus.size(); ++i)
      ASSERT_EQ(taken.imus[i].second.header.stamp_ns, whole.imus[i].second.header.stamp_ns);
    ASSERT_FALSE(taken.says("passed over")) << size;
  }
  const auto cut = take<UlogReader>(log.substr(0, log.size() - 5));
  EXPECT_EQ(cut.imus.size(), 49U);
  EXPECT_TRUE(cut.says("cut off"));
}

TEST(Ulog, BehindDamageTheNextSynchronisationLeadsOn) {
  std::string log = long_ulog(50);
  std::memset(log.data() + log.size() / 2, 0xEE, 100);
  const auto taken = take<UlogReader>(log);
  EXPECT_LT(taken.imus.size(), 50U);
  EXPECT_GE(taken.imus.size(), 36U) << "ten messages stand between two synchronisations";
  EXPECT_EQ(taken.imus.back().second.angular_velocity[0], 49.0);
  EXPECT_TRUE(taken.says("passed over"));
}

/// A crash log is written after what was logged, whose last message may be torn.
TEST(Ulog, AppendedDataIsReadBehindATornMessage) {
  const std::string body = kCombined + subscription(0, 7, "sensor_combined") + data(7, combined(4000, 1.0F));
  const std::string torn = data(7, combined(8000, 2.0F)).substr(0, 20);
  const std::uint64_t offset = ulog_begin().size() + body.size() + torn.size();
  const auto taken = take<UlogReader>(ulog_begin(1, offset) + body + torn + data(7, combined(12'000, 3.0F)));
  ASSERT_EQ(taken.imus.size(), 2U);
  EXPECT_EQ(taken.imus[1].second.angular_velocity[0], 3.0);
}

TEST(Ulog, WhatIsNoLogOrOfANewerKindIsRefused) {
  EXPECT_NE(take<UlogReader>("text").error.find("no ULog"), std::string::npos);
  EXPECT_NE(take<UlogReader>("").error.find("no ULog"), std::string::npos);
  EXPECT_NE(take<UlogReader>(ulog_begin(2)).error.find("newer kind"), std::string::npos);
  EXPECT_FALSE(UlogReader::open("/nowhere/at_all.ulg"));
}

/// Formats that hold themselves, arrays without end, parts in parts: refused, and nothing grows.
TEST(Ulog, FormatsThatLieAreRefused) {
  for (const std::string& lie :
       {format("sensor_combined:sensor_combined self;uint64_t timestamp;"),
        format("sensor_combined:uint64_t timestamp;float[99999999999] gyro_rad;"),
        format("sensor_combined:a[60000] x;") + format("a:b[60000] x;") + format("b:c[60000] x;") +
            format("c:uint8_t x;"),
        format("sensor_combined:nothing_known x;"), format("sensor_combined:float"), std::string()}) {
    const auto taken = take<UlogReader>(ulog_begin() + lie + subscription(0, 7, "sensor_combined") +
                                        data(7, combined(4000, 1.0F)));
    EXPECT_EQ(taken.messages(), 0U);
    EXPECT_TRUE(taken.says("damaged"));
  }
  // Arrays of parts that are known are passed by.
  const auto nested =
      take<UlogReader>(ulog_begin() + format("part:uint16_t a;uint8_t b;") +
                       format("sensor_gyro:uint64_t timestamp;part[2] parts;float x;float y;float z;") +
                       subscription(2, 7, "sensor_gyro") +
                       data(7, Bytes() << std::uint64_t{5} << std::uint16_t{1} << std::uint8_t{2}
                                       << std::uint16_t{3} << std::uint8_t{4} << 1.0F << 2.0F << 3.0F));
  ASSERT_EQ(nested.imus.size(), 1U);
  EXPECT_EQ(nested.imus[0].first, "sensor_gyro/2");
  EXPECT_EQ(nested.imus[0].second.angular_velocity, (mcap::Vector{1, 2, 3}));
  EXPECT_EQ(nested.imus[0].second.linear_acceleration_covariance[0], mcap::kNotMeasured);
}

/// Every message that is taken, with fields that are all different, and what each may lack.
std::string rich_ulog() {
  std::string log = ulog_begin() + kCombined + kVehicleImu;
  const std::string sensor = "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;";
  log += format("sensor_gyro:" + sensor) + format("sensor_accel:" + sensor) +
         format("sensor_baro:" + sensor) + format("part:float[2] a;int16_t b;") +
         format("vehicle_imu_old:x y;");
  log += subscription(0, 1, "sensor_combined") + subscription(0, 2, "vehicle_imu") +
         subscription(1, 3, "vehicle_imu") + subscription(0, 4, "sensor_gyro") +
         subscription(2, 5, "sensor_accel") + subscription(0, 6, "sensor_baro");
  log += data(1, combined(1'000'000, 1.0F)) + data(1, combined(1'004'000, 1.5F, 2'147'483'647)) +
         data(1, combined(1'008'000, 1.75F, -1500));
  Bytes spans;
  spans << std::uint64_t{1'010'000} << 1.0F << 2.0F << 3.0F << std::uint32_t{2000} << std::int32_t{250}
        << 4.0F << 5.0F << -9.5F << std::uint32_t{6000} << std::uint8_t{0};
  log += data(1, spans);
  const auto increments = [](std::uint16_t gyro_us, std::uint16_t accel_us) {
    Bytes fields;
    fields << std::uint64_t{2'000'500} << std::uint64_t{2'000'000} << std::uint32_t{1} << std::uint32_t{2}
           << 0.005F << 0.01F << -0.01F << 0.02F << 0.05F << -0.049F << gyro_us << accel_us
           << std::uint8_t{0};
    return fields;
  };
  log += data(2, increments(5000, 4000)) + data(3, increments(5000, 0)) + data(2, increments(0, 5000));
  Bytes value;
  value << std::uint64_t{3'000'500} << std::uint64_t{3'000'000} << 0.5F << 0.25F << 0.125F;
  for (const std::uint16_t id : {std::uint16_t{4}, std::uint16_t{5}, std::uint16_t{6}, std::uint16_t{77}})
    log += data(id, value);
  Bytes too_short;
  too_short << std::uint64_t{3'000'500} << std::uint64_t{3'000'000} << 0.5F << 0.25F;
  log += data(4, too_short);
  const std::string rest =
      "float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;int32_t timestamp_time_relative;uint8_t fix_type;bool vel_ned_valid;";
  log +=
      format(
          "vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;" +
          rest) +
      format(
          "sensor_gps:uint64_t timestamp;part[2] parts;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;double altitude_ellipsoid_m;" +
          rest);
  log += subscription(0, 10, "vehicle_gps_position") + subscription(3, 11, "sensor_gps");
  for (std::uint8_t fix_type = 0; fix_type < 8; ++fix_type) {
    Bytes old;
    old << std::uint64_t{5'000'000} << std::uint64_t{fix_type % 2 == 0 ? 1'700'000'000'123'456U : 0U}
        << std::int32_t{473'977'419} << std::int32_t{-1'218'000'000} << std::int32_t{500'000}
        << (fix_type == 4 ? 0.0F : 0.3F) << (fix_type == 5 ? -1.0F : 1.0F) << 0.2F << 1.0F
        << (fix_type == 3 ? NAN : -2.0F) << 0.5F << std::int32_t{-100'000} << fix_type
        << static_cast<std::uint8_t>(fix_type == 6 ? 0 : 1);
    log += data(10, old);
    Bytes fresh;
    fresh << std::uint64_t{5'200'000};
    for (int i = 0; i < 2; ++i) fresh << 1.0F << 2.0F << std::int16_t{3};
    fresh << std::uint64_t{1'700'000'000'323'456U} << 47.3977419 << -121.8 << 548.25 << 0.3F << 1.0F << 0.2F
          << 1.0F << -2.0F << 0.5F << std::int32_t{0} << fix_type << std::uint8_t{1};
    log += data(11, fresh);
  }
  Bytes dropout;
  dropout << std::uint16_t{250};
  log += message('O', dropout.text) + message('I', "info") + message('P', "parameter") + message('L', "log") +
         synchronisation() + data(1, combined(6'000'000, 2.0F));
  return log;
}

TEST(UlogWhole, MessagesOfEveryKind) {
  test::expect_recorded("logs/ulog.txt", test::whole_log_text<UlogReader>(rich_ulog()));
}

/// A field of every type before those that are read: their places show how long it is.
TEST(UlogWhole, FieldsOfEveryType) {
  std::string text;
  for (const char* type :
       {"int8_t",     "uint8_t",  "bool",           "char",           "int16_t",   "uint16_t",
        "int32_t",    "uint32_t", "int64_t",        "uint64_t",       "float",     "double",
        "uint8_t[3]", "float[0]", "uint8_t[65535]", "uint8_t[65536]", "uint8_t[3", "uint8_t[]",
        "uint8_t[x]", "part",     "part[2]",        "part[70]",       "other"}) {
    Bytes fields;
    for (int i = 0; i < 60; ++i) fields << static_cast<std::uint8_t>(i < 20 ? 3 * i : 1);
    const std::string head =
        ulog_begin() + format("part:float[2] a;int16_t b;;") +
        format(std::string("sensor_gyro:") + type + " extra;uint32_t timestamp;float x;float y;float z");
    text += std::string(type) + ' ' +
            test::whole_log_text<UlogReader>(head + subscription(0, 1, "sensor_gyro") + data(1, fields));
    const std::string span = ulog_begin() + format("part:float[2] a;int16_t b;;") +
                             format(std::string("sensor_combined:uint64_t timestamp;float[3] gyro_rad;") +
                                    type + " gyro_integral_dt;");
    text += test::whole_log_text<UlogReader>(span + subscription(0, 1, "sensor_combined") + data(1, fields));
  }
  for (int depth = 6; depth < 12; ++depth) {
    std::string log = ulog_begin() + format("p0:uint32_t timestamp;");
    for (int i = 1; i <= depth; ++i) log += format(fmt::format("p{}:p{} inner;", i, i - 1));
    log += format(fmt::format("sensor_gyro:p{} first;uint32_t timestamp;float x;float y;float z;", depth));
    Bytes fields;
    for (int i = 0; i < 40; ++i) fields << static_cast<std::uint8_t>(3 * i);
    text += fmt::format("{} ", depth) +
            test::whole_log_text<UlogReader>(log + subscription(0, 1, "sensor_gyro") + data(1, fields));
  }
  for (const int fields_n : {4090, 4091, 4092, 4093}) {
    std::string many = "sensor_gyro:uint32_t timestamp;float x;float y;float z;";
    for (int i = 0; i < fields_n; ++i) many += "bool f;";
    Bytes fields;
    for (int i = 0; i < 40; ++i) fields << static_cast<std::uint8_t>(3 * i);
    text += fmt::format("{} ", fields_n) +
            test::short_log_text<UlogReader>(ulog_begin() + format(many) + subscription(0, 1, "sensor_gyro") +
                                             data(1, fields)) +
            '\n';
  }
  test::expect_recorded("logs/ulog_fields.txt", text);
}

TEST(UlogWhole, DamageCutsAndAppendedParts) {
  const std::string log = rich_ulog();
  std::string text = test::damaged_log_text<UlogReader>(log.size(), 23, [&](std::size_t at) {
    std::string bytes = log;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x15);
    return bytes;
  });
  text +=
      test::damaged_log_text<UlogReader>(log.size(), 71, [&](std::size_t at) { return log.substr(0, at); });
  const std::string body = kCombined + subscription(0, 7, "sensor_combined") + data(7, combined(4000, 1.0F)) +
                           data(7, combined(8000, 2.0F));
  const std::string behind = data(7, combined(12'000, 3.0F)) + data(7, combined(16'000, 4.0F));
  const std::size_t head = ulog_begin().size();
  text += test::damaged_log_text<UlogReader>(
      body.size(), 1, [&](std::size_t at) { return ulog_begin(1, head + at) + body.substr(0, at) + behind; });
  text += test::damaged_log_text<UlogReader>(
      60, 1, [&](std::size_t at) { return ulog_begin(1, head + body.size() + at - 30) + body + behind; });
  for (const std::uint8_t incompatible :
       {std::uint8_t{0}, std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3}, std::uint8_t{128}})
    text += test::short_log_text<UlogReader>(ulog_begin(incompatible, 5) + body) + '\n';
  for (std::size_t at = 0; at < head; ++at) {
    std::string bytes = ulog_begin() + body;
    bytes[at] = static_cast<char>(bytes[at] + 2);
    text += fmt::format("{} ", at) + test::short_log_text<UlogReader>(bytes) + '\n';
  }
  for (const std::size_t n : {1U, 65'520U, 65'530U, 65'536U, 65'546U, 131'072U})
    text += test::short_log_text<UlogReader>(ulog_begin() + body + std::string(n, '\xEE') +
                                             synchronisation() + behind) +
            '\n';
  test::expect_recorded("logs/ulog_damage.txt", text);
}

}  // namespace
}  // namespace imuscope::flight_log
