/// What is taken of a DataFlash log of ArduPilot, old and new, whole, cut and damaged.

#include "logs/flight_log/dataflash_reader.h"

#include <cmath>

#include "logs.h"
#include "tests/support/messages_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::flight_log {
namespace {

std::string record(std::uint8_t kind, const std::string& content) {
  return std::string("\xA3\x95", 2) + static_cast<char>(kind) + content;
}
std::string format(std::uint8_t kind, std::size_t size, const std::string& name,
                   const std::string& characters, const std::string& labels) {
  Bytes content;
  content << kind << static_cast<std::uint8_t>(size);
  return record(kDataflashFormat,
                content.text + padded(name, 4) + padded(characters, 16) + padded(labels, 64));
}
std::string begin() { return format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"); }

const std::string kImu = format(150, 3 + 8 + 1 + 24 + 8 + 4 + 2 + 4, "IMU", "QBffffffIIfBBHH",
                                "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz");

std::string imu(std::uint64_t us, std::uint8_t instance, float x, std::uint8_t gyro_health = 1) {
  Bytes fields;
  fields << us << instance << x << 0.2F << 0.3F << 1.0F << 2.0F << -9.8F << std::uint32_t{0}
         << std::uint32_t{0} << 25.0F << gyro_health << std::uint8_t{1} << std::uint16_t{1000}
         << std::uint16_t{1000};
  return record(150, fields.text);
}

TEST(Dataflash, EveryImuHasItsTopic) {
  const auto taken = take<DataflashReader>(begin() + kImu + imu(1'000'000, 0, 0.1F) +
                                           imu(1'000'010, 1, 0.5F) + imu(1'020'000, 0, 0.0F, 0));
  ASSERT_EQ(taken.imus.size(), 3U) << taken.error;
  EXPECT_EQ(taken.imus[0].first, "IMU/0");
  EXPECT_EQ(taken.imus[1].first, "IMU/1");
  EXPECT_EQ(taken.imus[0].second.header.stamp_ns, 1'000'000'000);
  EXPECT_FLOAT_EQ(static_cast<float>(taken.imus[1].second.angular_velocity[0]), 0.5F);
  EXPECT_FLOAT_EQ(static_cast<float>(taken.imus[0].second.linear_acceleration[2]), -9.8F);
  EXPECT_EQ(taken.imus[2].second.angular_velocity_covariance[0], mcap::kNotMeasured) << "a gyro that is ill";
  EXPECT_TRUE(taken.losses.empty());
}

TEST(Dataflash, OldLogsNumberTheirRecordsAndCountMilliseconds) {
  Bytes fields;
  fields << std::uint32_t{2500} << 1.0F << 2.0F << 3.0F << 4.0F << 5.0F << 6.0F;
  const auto taken = take<DataflashReader>(
      begin() + format(151, 3 + 28, "IMU2", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ") +
      record(151, fields.text));
  ASSERT_EQ(taken.imus.size(), 1U);
  EXPECT_EQ(taken.imus[0].first, "IMU/1");
  EXPECT_EQ(taken.imus[0].second.header.stamp_ns, 2'500'000'000);
}

const std::string kGps =
    format(130, 3 + 8 + 1 + 1 + 4 + 2 + 1 + 2 + 4 + 4 + 4 + 16 + 1, "GPS", "QBBIHBcLLeffffB",
           "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U");

std::string gps(std::uint64_t us, std::uint8_t status) {
  Bytes fields;
  // 2023-11-14 22:13:20 UTC is 18 s later in GPS time: week 2288, second 252,818.
  fields << us << std::uint8_t{0} << status << std::uint32_t{252'818'250} << std::uint16_t{2288}
         << std::uint8_t{14} << std::int16_t{80} << std::int32_t{473'977'419} << std::int32_t{-1'218'000'000}
         << std::int32_t{54'825} << 5.0F << 90.0F << -0.5F << 0.0F << std::uint8_t{1};
  return record(130, fields.text);
}

TEST(Dataflash, APositionTakesItsAccuracyAndUtc) {
  Bytes accuracy;
  accuracy << std::uint64_t{3'000'000} << std::uint8_t{0} << std::uint16_t{120} << std::uint16_t{2}
           << std::uint16_t{3} << std::uint16_t{30} << std::uint8_t{1} << std::uint32_t{2'990} << -48.0F;
  const auto taken = take<DataflashReader>(
      begin() + kGps +
      format(131, 3 + 8 + 1 + 8 + 1 + 4 + 4, "GPA", "QBCCCCBIf", "TimeUS,I,VDop,HAcc,VAcc,SAcc,VV,SMS,Und") +
      gps(3'000'000, 6) + record(131, accuracy.text) + gps(3'200'000, 2));
  ASSERT_EQ(taken.fixes.size(), 2U);
  const auto& [topic, fix] = taken.fixes[0];
  EXPECT_EQ(topic, "GPS/0");
  EXPECT_EQ(fix.header.stamp_ns, 2'990'000'000) << "when the receiver's message came";
  EXPECT_NEAR(fix.latitude_deg, 47.3977419, 1e-9);
  EXPECT_NEAR(fix.longitude_deg, -121.8, 1e-9);
  EXPECT_NEAR(fix.altitude_m, 548.25 + 48.0, 1e-4);
  EXPECT_EQ(fix.status, 2);
  EXPECT_NEAR(std::sqrt(fix.position_covariance[8]), 0.03, 1e-9);
  EXPECT_EQ(taken.fixes[1].second.status, -1);
  EXPECT_EQ(taken.fixes[1].second.position_covariance_type, 0);
  ASSERT_EQ(taken.velocities.size(), 1U);
  const auto& velocity = taken.velocities[0].second.linear_mps;
  EXPECT_NEAR(velocity[0], 5.0, 1e-6) << "east";
  EXPECT_NEAR(velocity[1], 0.0, 1e-6) << "north";
  EXPECT_NEAR(velocity[2], 0.5, 1e-6) << "up";
  ASSERT_GE(taken.times.size(), 1U);
  EXPECT_EQ(taken.times[0].second.time_ref_ns, 1'700'000'000'250'000'000);
  EXPECT_FALSE(taken.says("above the sea"));
}

TEST(Dataflash, HeightsAboveTheSeaAreTold) {
  const auto taken = take<DataflashReader>(begin() + kGps + gps(3'000'000, 3));
  ASSERT_EQ(taken.fixes.size(), 1U);
  EXPECT_NEAR(taken.fixes[0].second.altitude_m, 548.25, 1e-9);
  EXPECT_EQ(taken.fixes[0].second.status, 0);
  EXPECT_TRUE(taken.says("above the sea"));
}

TEST(Dataflash, BatchesAreSamplesOfTheirOwnRate) {
  Bytes head;
  head << std::uint64_t{900'000} << std::uint16_t{5} << std::uint8_t{1} << std::uint8_t{0}
       << std::uint16_t{938} << std::uint16_t{40} << std::uint64_t{1'000'000} << 2000.0F;
  const auto piece = [](std::uint16_t number, std::uint16_t sequence) {
    Bytes fields;
    fields << std::uint64_t{950'000} << number << sequence;
    for (int axis = 0; axis < 3; ++axis) {
      for (int i = 0; i < 32; ++i) fields << static_cast<std::int16_t>(938 * (axis + 1));
    }
    return record(141, fields.text);
  };
  const auto taken = take<DataflashReader>(
      begin() +
      format(140, 3 + 28, "ISBH", "QHBBHHQf", "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate") +
      format(141, 3 + 12 + 192, "ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z") + record(140, head.text) +
      piece(5, 0) + piece(5, 1) + piece(6, 0));
  ASSERT_EQ(taken.imus.size(), 40U) << "no more than the head says, and none of another batch";
  EXPECT_EQ(taken.imus[0].first, "ISB/0/gyro");
  EXPECT_EQ(taken.imus[0].second.angular_velocity, (mcap::Vector{1, 2, 3}));
  EXPECT_EQ(taken.imus[39].second.header.stamp_ns, 1'000'000'000 + 39 * 500'000);
  EXPECT_EQ(taken.imus[0].second.linear_acceleration_covariance[0], mcap::kNotMeasured);
}

std::string long_log(int n) {
  std::string log = begin() + kImu;
  for (int k = 0; k < n; ++k) log += imu(static_cast<std::uint64_t>(k) * 20'000, 0, static_cast<float>(k));
  return log;
}

TEST(Dataflash, OfACutLogWhatStandsBeforeTheCutIsUsed) {
  const std::string log = long_log(30);
  for (std::size_t size = 3; size < log.size(); ++size) {
    const auto taken = take<DataflashReader>(log.substr(0, size));
    ASSERT_TRUE(taken.error.empty());
    for (std::size_t i = 0; i < taken.imus.size(); ++i)
      ASSERT_EQ(taken.imus[i].second.angular_velocity[0], static_cast<double>(i));
  }
  const auto cut = take<DataflashReader>(log.substr(0, log.size() - 1));
  EXPECT_EQ(cut.imus.size(), 29U);
  EXPECT_TRUE(cut.says("cut off"));
}

TEST(Dataflash, WhatBeginsNoRecordIsPassedOver) {
  std::string log = long_log(30);
  std::memset(log.data() + log.size() / 2, 0, 80);
  const auto taken = take<DataflashReader>(log);
  EXPECT_GE(taken.imus.size(), 27U);
  EXPECT_LT(taken.imus.size(), 30U);
  EXPECT_EQ(taken.imus.back().second.angular_velocity[0], 29.0);
  EXPECT_TRUE(taken.says("passed over"));
}

TEST(Dataflash, FormatsThatLieAreRefused) {
  // Fields that are longer than the record, and a character that nobody knows.
  for (const std::string& lie :
       {format(150, 10, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        format(150, 200, "IMU", "Q?f", "TimeUS,I,GyrX"), format(150, 50, "GPS", "", "")}) {
    const auto taken = take<DataflashReader>(begin() + lie + std::string(200, '\x11'));
    EXPECT_EQ(taken.messages(), 0U);
    EXPECT_FALSE(taken.losses.empty());
  }
  // Numbers that are none, where a counter is meant.
  Bytes head;
  head << std::uint64_t{1} << NAN << std::uint8_t{1} << NAN << 1.0F << 1e30F << std::uint64_t{1} << 1e-30F;
  const auto taken = take<DataflashReader>(begin() +
                                           format(140, 3 + 8 + 4 + 1 + 4 + 4 + 4 + 8 + 4, "ISBH", "QfBfffQf",
                                                  "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate") +
                                           record(140, head.text));
  EXPECT_EQ(taken.messages(), 0U);
  EXPECT_TRUE(taken.says("damaged"));
}

TEST(Dataflash, WhatIsNoLogIsRefused) {
  EXPECT_NE(take<DataflashReader>("text").error.find("no DataFlash log"), std::string::npos);
  EXPECT_NE(take<DataflashReader>("").error.find("no DataFlash log"), std::string::npos);
  EXPECT_FALSE(DataflashReader::open("/nowhere/at_all.bin"));
}

/// Every kind of record that is taken, with fields that are all different, and what each may lack.
std::string rich_dataflash() {
  std::string log = begin() + kImu + kGps;
  log += imu(1'000'000, 0, 0.1F) + imu(1'000'010, 1, 0.5F) + imu(1'020'000, 0, 0.0F, 0) +
         imu(1'030'000, 31, 0.25F) + imu(1'040'000, 32, 0.25F);
  log += format(151, 3 + 28, "IMU2", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
  Bytes old;
  old << std::uint32_t{2500} << 1.0F << 2.0F << 3.0F << 4.0F << 5.0F << 6.0F;
  log += record(151, old.text);
  log += format(152, 3 + 8 + 1 + 8 * 4, "IMT", "QBffffffff",
                "TimeUS,I,DelaT,DelvT,DelAX,DelAY,DelAZ,DelVX,DelVY,DelVZ");
  for (const auto& [gyro_s, accel_s] :
       std::vector<std::pair<float, float>>{{0.02F, 0.025F}, {0.0F, 0.02F}, {0.02F, 0.0F}, {-0.02F, 0.02F}}) {
    Bytes increments;
    increments << std::uint64_t{1'100'000} << std::uint8_t{2} << gyro_s << accel_s << 0.01F << 0.02F << 0.03F
               << 0.1F << 0.2F << -0.2F;
    log += record(152, increments.text);
  }
  log += format(153, 3 + 8 + 8 + 1 + 12, "GYR", "QQBfff", "TimeUS,SampleUS,I,GyrX,GyrY,GyrZ");
  log += format(154, 3 + 8 + 12, "ACC1", "Qfff", "TimeUS,AccX,AccY,AccZ");
  log += format(155, 3 + 8 + 12, "ACC9", "Qfff", "TimeUS,AccX,AccY,AccZ") +
         format(156, 3 + 8 + 12, "ACC0", "Qfff", "TimeUS,AccX,AccY,AccZ") +
         format(157, 3 + 8 + 12, "BARO", "Qfff", "TimeUS,AccX,AccY,AccZ");
  Bytes fast;
  fast << std::uint64_t{1'200'500} << std::uint64_t{1'200'250} << std::uint8_t{1} << 0.75F << 0.5F << 0.25F;
  log += record(153, fast.text);
  Bytes acceleration;
  acceleration << std::uint64_t{1'300'000} << 7.0F << 8.0F << 9.0F;
  for (const std::uint8_t kind : {std::uint8_t{154}, std::uint8_t{155}, std::uint8_t{156}, std::uint8_t{157}})
    log += record(kind, acceleration.text);
  log += format(140, 3 + 8 + 2 + 1 + 1 + 2 + 2 + 8 + 4, "ISBH", "QHBBHHQf",
                "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate") +
         format(141, 3 + 8 + 2 + 2 + 3 * 64, "ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z");
  const auto head = [](std::uint16_t number, std::uint8_t type, std::uint16_t multiplier,
                       std::uint16_t samples, float rate_hz) {
    Bytes fields;
    fields << std::uint64_t{900'000} << number << type << std::uint8_t{2} << multiplier << samples
           << std::uint64_t{800'000} << rate_hz;
    return record(140, fields.text);
  };
  const auto batch = [](std::uint16_t number, std::uint16_t piece) {
    Bytes fields;
    fields << std::uint64_t{900'100} << number << piece;
    for (int axis = 0; axis < 3; ++axis) {
      for (int i = 0; i < 32; ++i) fields << static_cast<std::int16_t>(100 * axis + i - 50 * (piece + 1));
    }
    return record(141, fields.text);
  };
  log += batch(5, 0) + head(5, 1, 16, 35, 1000.0F) + batch(5, 0) + batch(6, 0) + batch(5, 1) + batch(5, 2) +
         head(7, 0, 8, 3, 500.0F) + batch(7, 0) + head(8, 1, 0, 3, 500.0F) + batch(8, 0) +
         head(9, 1, 1, 3, 0.0F) + batch(9, 0);
  log +=
      format(131, 3 + 8 + 1 + 8 + 1 + 4 + 4, "GPA", "QBCCCCBIf", "TimeUS,I,VDop,HAcc,VAcc,SAcc,VV,SMS,Und");
  const auto accuracy = [](std::uint64_t us, std::uint8_t instance, std::uint16_t horizontal,
                           std::uint8_t has_down, std::uint32_t ms, float undulation) {
    Bytes fields;
    fields << us << instance << std::uint16_t{120} << horizontal << std::uint16_t{3} << std::uint16_t{30}
           << has_down << ms << undulation;
    return record(131, fields.text);
  };
  for (const std::uint8_t status : {std::uint8_t{0}, std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3},
                                    std::uint8_t{4}, std::uint8_t{5}, std::uint8_t{6}, std::uint8_t{7}})
    log += gps(3'000'000U + 200'000U * status, status);
  log += accuracy(4'400'000, 0, 2, 1, 4'390, -48.0F) + gps(5'000'000, 6) +
         accuracy(5'000'000, 1, 2, 1, 4'990, -48.0F) + accuracy(5'000'001, 0, 2, 1, 4'990, -48.0F);
  log += gps(5'200'000, 6) + accuracy(5'200'000, 0, 0, 1, 0, 0.0F) + gps(5'400'000, 6) +
         accuracy(5'400'000, 0, 2, 0, 5'401, NAN) + gps(5'600'000, 6) +
         accuracy(5'600'000, 0, 2, 1, 5'600, 12.5F) + gps(5'800'000, 3);
  return log;
}

TEST(DataflashWhole, RecordsOfEveryKind) {
  test::expect_recorded("logs/dataflash.txt", test::whole_log_text<DataflashReader>(rich_dataflash()));
}

TEST(DataflashWhole, WeeksAndTheirMilliseconds) {
  std::string text;
  for (const std::uint16_t week : {std::uint16_t{0}, std::uint16_t{1}, std::uint16_t{1929},
                                   std::uint16_t{1930}, std::uint16_t{9999}, std::uint16_t{10'000}}) {
    for (const std::uint32_t ms : {0U, 18'000U, 1'999U, 604'799'999U, 604'800'000U}) {
      std::string fix = gps(3'000'000, 6);
      std::memcpy(fix.data() + 3 + 10, &ms, sizeof ms);
      std::memcpy(fix.data() + 3 + 14, &week, sizeof week);
      const auto taken = take<DataflashReader>(begin() + kGps + fix);
      text +=
          fmt::format("{} {}: {}\n", week, ms,
                      taken.times.empty() ? "nothing" : test::grouped_ns(taken.times[0].second.time_ref_ns));
    }
  }
  test::expect_recorded("logs/dataflash_weeks.txt", text);
}

/// A number of every character, and one field too many or too few.
TEST(DataflashWhole, FieldsOfEveryCharacter) {
  std::string text;
  const std::string values("\x21\x43\x65\x87\x12\x34\x56\x3F\x21\x43\x65\x47\x12\x34\x56\x41\x21\x43\x65\x87",
                           20);
  for (const char character : std::string("abBcCdefEghHiILMnNqQZx")) {
    // The time stands after the field, so that its place shows how long the field is.
    for (const std::size_t size : {31U, 40U, 60U, 90U}) {
      std::string content;
      for (std::size_t i = 0; i + 3 < size; ++i)
        content += i < values.size() ? values[i] : static_cast<char>(i % 5);
      text += fmt::format("{} {}: {}", character, size,
                          test::whole_log_text<DataflashReader>(
                              begin() +
                              format(160, size, "IMU", std::string(1, character) + "Iffffff",
                                     "GH,TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ") +
                              record(160, content)));
      text += test::whole_log_text<DataflashReader>(
          begin() + format(160, size, "GYR", std::string(1, character) + "ffI", "GyrX,GyrY,GyrZ,TimeMS") +
          record(160, content));
    }
  }
  test::expect_recorded("logs/dataflash_fields.txt", text);
}

TEST(DataflashWhole, DamageAndCuts) {
  const std::string log = rich_dataflash();
  std::string text = test::damaged_log_text<DataflashReader>(log.size(), 17, [&](std::size_t at) {
    std::string bytes = log;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x15);
    return bytes;
  });
  text += test::damaged_log_text<DataflashReader>(log.size(), 53,
                                                  [&](std::size_t at) { return log.substr(0, at); });
  const std::string plain = begin() + kImu + imu(1'000'000, 0, 0.1F) + imu(1'010'000, 0, 0.1F);
  text += test::damaged_log_text<DataflashReader>(plain.size(), 1, [&](std::size_t at) {
    std::string bytes = plain;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x15);
    return bytes;
  });
  for (const std::size_t n :
       {1U, 65'534U, 65'535U, 65'536U, 65'537U, 70'000U, 1'048'500U, 1'048'576U, 1'100'000U})
    text += test::short_log_text<DataflashReader>(begin() + kImu + imu(1'000'000, 0, 0.1F) +
                                                  std::string(n, 'x') + imu(1'010'000, 0, 0.1F)) +
            '\n';
  test::expect_recorded("logs/dataflash_damage.txt", text);
}

}  // namespace
}  // namespace imuscope::flight_log
