// Rows to samples: units, axes, time, gaps, mistakes.
#include "drivers/csv/decoder.h"

#include <gtest/gtest.h>
#include <algorithm>

#include "base/units.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::csv {
namespace {

using test::bytes_of;
using namespace std::chrono_literals;

constexpr std::string_view kHeader =
    "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";

std::vector<Sample> decode(RowDecoder& decoder, std::string_view text) {
  test::CollectingSink sink;
  decoder.push(bytes_of(text), {}, sink);
  decoder.finish({}, sink);
  return sink.samples;
}

std::vector<Sample> decode_imu(std::string_view rows, const ImuConfig& config = {}) {
  ImuDecoder decoder(config);
  return decode(decoder, std::string(kHeader) + std::string(rows));
}

TEST(CsvImu, AMinusBeforeAColumnTurnsItsSignBeforeTheAxes) {
  ImuConfig config;
  config.gyro_columns = {"gyro_y_radps", "-gyro_x_radps", "gyro_z_radps"};
  config.accel_columns = {"accel_x_mps2", "accel_y_mps2", "-accel_z_mps2"};
  config.axes = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  const auto samples = decode_imu("1.25,0.1,0.2,0.3,1,2,9.8\n", config);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].imu.omega_radps, (Vector3{0.2, 0.1, -0.3}));
  EXPECT_EQ(samples[0].imu.f_mps2, (Vector3{1.0, -2.0, 9.8}));
}

TEST(CsvImu, TimesHaveAUnitAndAnOffsetOfTheirOwn) {
  ImuConfig config;
  config.time_unit_s = 1e-3;
  config.time_offset_s = -18.0;
  const auto samples = decode_imu("20250,0,0,0,0,0,9.8\n", config);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(to_ns(samples[0].time), 2'250'000'000);
}

TEST(CsvImu, ARowBecomesASampleAtItsTime) {
  ImuConfig config;
  config.device = 2;
  config.clock = ClockMapConfig::fixed(host_time_from_ns(1'000), 1.0);
  const auto samples = decode_imu("1.25,0.1,0.2,0.3,1,2,9.8\n", config);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].kind, SampleKind::kImu);
  EXPECT_EQ(samples[0].device, 2);
  EXPECT_EQ(to_ns(samples[0].time), 1'250'001'000);
  EXPECT_EQ(samples[0].arrival, samples[0].time);
  EXPECT_FALSE(samples[0].has_utc);
  EXPECT_EQ(samples[0].imu.omega_radps, (Vector3{0.1, 0.2, 0.3}));
  EXPECT_EQ(samples[0].imu.f_mps2, (Vector3{1, 2, 9.8}));
  EXPECT_EQ(samples[0].imu.counter, 0);
  EXPECT_EQ(samples[0].imu.flags, kGyroValid | kAccelValid);
}

TEST(CsvImu, UnitsAndAxesAreConverted) {
  ImuConfig config;
  config.gyro_unit = AngularRateUnit::kDegps;
  config.accel_unit = AccelerationUnit::kG;
  config.time_unit_s = 1e-3;
  config.axes = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  const auto samples = decode_imu("1500,180,90,0,0,1,-1\n", config);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(to_ns(samples[0].time), 1'500'000'000);
  EXPECT_NEAR(samples[0].imu.omega_radps[0], kPi, 1e-15);
  EXPECT_NEAR(samples[0].imu.omega_radps[1], -kPi / 2, 1e-15);
  EXPECT_DOUBLE_EQ(samples[0].imu.f_mps2[1], -9.80665);
  EXPECT_DOUBLE_EQ(samples[0].imu.f_mps2[2], 9.80665);
}

TEST(CsvImu, CommentsBlankLinesQuotesCrLfSpacesAndExtraColumnsDoNotMatter) {
  ImuDecoder decoder({});
  const auto samples = decode(
      decoder,
      "\xEF\xBB\xBF# made by a logger\r\n\r\nnote;\"t_s\"; "
      "gyro_x_radps;gyro_y_radps;gyro_z_radps;accel_x_mps2;"
      "accel_y_mps2;accel_z_mps2;temperature\r\n# rows\r\nfirst; 0.5 ;+1;2;3;4;5;6;n/a\r\n;0.6;1;2;3;4;5;6");
  ASSERT_EQ(samples.size(), 2U) << describe(decoder.error());
  EXPECT_EQ(samples[0].imu.omega_radps, (Vector3{1, 2, 3}));
  EXPECT_EQ(samples[1].imu.f_mps2, (Vector3{4, 5, 6}));
  EXPECT_EQ(decoder.counters().bad_contents, 0U);
}

TEST(CsvImu, EverySplitIntoReadsGivesTheSameSamples) {
  const std::string text = std::string(kHeader) + "0,1,2,3,4,5,6\r\n0.01,1,2,3,4,5,7\r\n0.02,1,2,3,4,5,8\r\n";
  for (std::size_t at = 0; at <= text.size(); ++at) {
    ImuDecoder decoder({});
    test::CollectingSink sink;
    decoder.push(bytes_of(text.substr(0, at)), {}, sink);
    decoder.push(bytes_of(text.substr(at)), {}, sink);
    ASSERT_EQ(sink.samples.size(), 3U) << at;
    ASSERT_EQ(sink.samples[2].imu.f_mps2[2], 8.0) << at;
  }
}

TEST(CsvImu, AGapInTheTimeColumnIsCountedAndMarked) {
  ImuConfig config;
  config.period = 10ms;
  ImuDecoder decoder(config);
  const auto samples = decode(decoder, std::string(kHeader) +
                                           "0.00,1,2,3,4,5,6\n0.01,1,2,3,4,5,6\n0.05,1,2,3,4,5,6\n"
                                           "0.064,1,2,3,4,5,6\n");
  ASSERT_EQ(samples.size(), 4U);
  EXPECT_EQ(decoder.counters().samples_lost, 3U);
  EXPECT_EQ(samples[1].imu.flags & kGapBefore, 0U);
  EXPECT_NE(samples[2].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(samples[3].imu.flags & kGapBefore, 0U);  // 1.4 periods
  EXPECT_EQ(samples[3].imu.counter, 3);
}

TEST(CsvImu, ThePeriodIsLearnedWhereNoneIsConfigured) {
  ImuDecoder decoder({});
  std::string text(kHeader);
  for (int i = 0; i < 30; ++i) text += std::to_string(0.02 * i) + ",1,2,3,4,5,6\n";
  text += "0.70,1,2,3,4,5,6\n";  // row 35 of the 50 Hz grid after row 29
  const auto samples = decode(decoder, text);
  ASSERT_EQ(samples.size(), 31U);
  EXPECT_EQ(decoder.counters().samples_lost, 5U);
  EXPECT_NE(samples.back().imu.flags & kGapBefore, 0U);
}

TEST(CsvImu, ACounterColumnCountsLossesAndIsUnwrapped) {
  ImuConfig config;
  config.counter_column = "n";
  ImuDecoder decoder(config);
  std::string text = "n," + std::string(kHeader);
  for (const char* row : {"65533,0.00", "65534,0.01", "1,0.04", "2,0.05"})
    text += std::string(row) + ",1,2,3,4,5,6\n";
  const auto samples = decode(decoder, text);
  ASSERT_EQ(samples.size(), 4U) << describe(decoder.error());
  EXPECT_EQ(samples[2].imu.counter, 65537);
  EXPECT_EQ(samples[3].imu.counter, 65538);
  EXPECT_EQ(decoder.counters().samples_lost, 2U);  // 65535 and 0
  EXPECT_NE(samples[2].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(samples[3].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(decoder.counters().clock_resets, 0U);
}

TEST(CsvImu, ACounterThatRepeatsOrCannotBeIsAMistakeAndOneThatBeginsAnewIsNot) {
  ImuConfig config;
  config.counter_column = "n";
  for (const char* bad : {"1", "1.5", "1e18", "-1e18"}) {
    ImuDecoder decoder(config);
    std::string text = "n," + std::string(kHeader);
    for (const std::string& row :
         {std::string("0,0.00"), std::string("1,0.01"), std::string(bad) + ",0.02", std::string("2,0.03")})
      text += row + ",1,2,3,4,5,6\n";
    const auto samples = decode(decoder, text);
    EXPECT_EQ(samples.size(), 3U) << bad;
    EXPECT_EQ(decoder.counters().bad_contents, 1U) << bad;
    EXPECT_EQ(decoder.error().kind, RowError::Kind::kOutOfRange) << bad;
    EXPECT_STREQ(decoder.error().column.data(), "n") << bad;
    EXPECT_EQ(decoder.counters().samples_lost, 0U) << bad;
  }
  ImuDecoder decoder(config);
  std::string text = "n," + std::string(kHeader);
  for (const char* row : {"20000,0.00", "20001,0.01", "5,0.02", "6,0.03"})
    text += std::string(row) + ",1,2,3,4,5,6\n";
  const auto samples = decode(decoder, text);
  ASSERT_EQ(samples.size(), 4U) << describe(decoder.error());
  EXPECT_EQ(decoder.counters().clock_resets, 1U);
  EXPECT_EQ(decoder.counters().samples_lost, 0U);
  EXPECT_NE(samples[2].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(samples[3].imu.flags & kGapBefore, 0U);
}

TEST(CsvImu, ACounterOf32BitsIsUnwrapped) {
  ImuConfig config;
  config.counter_column = "n";
  ImuDecoder decoder(config);
  std::string text = "n," + std::string(kHeader);
  for (const char* row : {"4294967294,0.00", "4294967295,0.01", "0,0.02"})
    text += std::string(row) + ",1,2,3,4,5,6\n";
  const auto samples = decode(decoder, text);
  ASSERT_EQ(samples.size(), 3U) << describe(decoder.error());
  EXPECT_EQ(samples[2].imu.counter, std::int64_t{1} << 32U);
  EXPECT_EQ(samples[2].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(decoder.counters().samples_lost, 0U);
}

struct BadRow {
  const char* row;
  RowError::Kind kind;
  const char* column;
};

TEST(CsvImu, TheFirstMistakeIsToldWithLineAndColumnAndTheOtherRowsGoOn) {
  using Kind = RowError::Kind;
  for (const BadRow& bad : {
           BadRow{"0.01,1,2,3,four,5,6", Kind::kNotANumber, "accel_x_mps2"},
           BadRow{"0.01,1,2,3,4,5,6x", Kind::kNotANumber, "accel_z_mps2"},
           BadRow{"0.01,1,2,3,4,5,0x10", Kind::kNotANumber, "accel_z_mps2"},
           BadRow{"0.01,1,,3,4,5,6", Kind::kNoValue, "gyro_y_radps"},
           BadRow{"0.01,1,2,3", Kind::kNoValue, "accel_x_mps2"},
           BadRow{"0.01,1,2,3,4,5,nan", Kind::kOutOfRange, "accel_z_mps2"},
           BadRow{"0.01,1,2,3,4,5,1e999", Kind::kOutOfRange, "accel_z_mps2"},
           BadRow{"-0.01,1,2,3,4,5,6", Kind::kTimeGoesBack, "t_s"},
           BadRow{"1e300,1,2,3,4,5,6", Kind::kOutOfRange, "t_s"},
       }) {
    SCOPED_TRACE(bad.row);
    ImuDecoder decoder({});
    const auto samples = decode(decoder, std::string(kHeader) + "0,1,2,3,4,5,6\n" + bad.row +
                                             "\n0.02,1,2,3,4,5,6\n" + "0.03,x,2,3,4,5,6\n");
    EXPECT_EQ(samples.size(), 2U);
    EXPECT_EQ(decoder.counters().bad_contents, 2U);
    EXPECT_EQ(decoder.error().kind, bad.kind);
    EXPECT_EQ(decoder.error().line, 3U);
    EXPECT_STREQ(decoder.error().column.data(), bad.column);
    EXPECT_NE(describe(decoder.error()).find("line 3"), std::string::npos);
    EXPECT_NE(describe(decoder.error()).find(bad.column), std::string::npos);
  }
}

TEST(CsvImu, AMissingColumnGivesNoSampleAtAll) {
  ImuDecoder decoder({});
  const auto samples = decode(decoder, "t_s,gyro_x_radps\n0,1\n0.01,1\n");
  EXPECT_TRUE(samples.empty());
  EXPECT_EQ(decoder.error().kind, RowError::Kind::kMissingColumn);
  EXPECT_STREQ(decoder.error().column.data(), "gyro_y_radps");
}

TEST(CsvImu, ALineWithoutEndIsGivenUpInBoundedMemory) {
  ImuDecoder decoder({});
  const auto samples = decode(
      decoder, std::string(kHeader) + "0,1,2,3,4,5,6\n" + std::string(100'000, '7') + "\n0.01,1,2,3,4,5,6\n");
  EXPECT_EQ(samples.size(), 2U);
  EXPECT_EQ(decoder.error().kind, RowError::Kind::kLineTooLong);
  EXPECT_EQ(decoder.error().line, 3U);
  EXPECT_NE(describe(decoder.error()).find("line 3: the line is longer"), std::string::npos);
}

GnssConfig every_column() {
  GnssConfig config;
  config.velocity_columns = {"vn", "ve", "vd"};
  config.position_sd_columns = {"sn", "se", "sd"};
  config.velocity_sd_columns = {"svn", "sve", "svd"};
  config.solution_column = "Q";
  return config;
}

TEST(CsvGnss, ARowWithEverythingBecomesASolution) {
  GnssDecoder decoder(every_column());
  const auto samples = decode(decoder,
                              "t_s,lat_deg,lon_deg,height_m,vn,ve,vd,sn,se,sd,svn,sve,svd,Q\n"
                              "0.0,45,270,100,1,2,3,0.1,0.2,0.3,0.4,0.5,0.6,2\n"
                              "0.2,45,270,100,,2,3,0.1,0.2,,0.4,0.5,0.6,1\n"
                              "0.4,45,270,100,1,2,3,0.1,0.2,0.3,0.4,0.5,0.6,0\n");
  ASSERT_EQ(samples.size(), 3U) << describe(decoder.error());
  EXPECT_EQ(samples[0].kind, SampleKind::kGnss);
  EXPECT_DOUBLE_EQ(samples[0].gnss.latitude_rad, kPi / 4);
  EXPECT_DOUBLE_EQ(samples[0].gnss.longitude_rad, -kPi / 2);
  EXPECT_EQ(samples[0].gnss.height_m, 100.0);
  EXPECT_EQ(samples[0].gnss.v_n_mps, (Vector3{1, 2, 3}));
  EXPECT_EQ(samples[0].gnss.sd_position_m, (Vector3{0.1, 0.2, 0.3}));
  EXPECT_EQ(samples[0].gnss.sd_velocity_mps, (Vector3{0.4, 0.5, 0.6}));
  EXPECT_EQ(samples[0].gnss.solution, GnssSolution::kFloat);
  EXPECT_EQ(samples[0].gnss.flags, kPositionValid | kVelocityValid | kHasPositionSd | kHasVelocitySd);
  EXPECT_EQ(samples[1].gnss.flags, static_cast<std::uint32_t>(kPositionValid));
  EXPECT_EQ(samples[1].gnss.solution, GnssSolution::kFixed);
  EXPECT_EQ(samples[2].gnss.solution, GnssSolution::kNone);
  EXPECT_EQ(samples[2].gnss.flags, 0U);
}

TEST(CsvGnss, NmeaQualityNumbersAreNotThoseOfRtklib) {
  GnssConfig config;
  config.solution_column = "Q";
  config.solution_code = SolutionCode::kNmea;
  GnssDecoder decoder(config);
  const auto samples =
      decode(decoder, "t_s,lat_deg,lon_deg,height_m,Q\n0,45,5,100,4\n1,45,5,100,5\n2,45,5,100,1\n");
  ASSERT_EQ(samples.size(), 3U);
  EXPECT_EQ(samples[0].gnss.solution, GnssSolution::kFixed);
  EXPECT_EQ(samples[1].gnss.solution, GnssSolution::kFloat);
  EXPECT_EQ(samples[2].gnss.solution, GnssSolution::kSingle);
}

TEST(CsvGnss, APlaceThatCannotBeIsAMistake) {
  GnssDecoder decoder({});
  EXPECT_TRUE(decode(decoder, "t_s,lat_deg,lon_deg,height_m\n0,95,5,100\n").empty());
  EXPECT_EQ(decoder.error().kind, RowError::Kind::kOutOfRange);
  EXPECT_STREQ(decoder.error().column.data(), "lat_deg");
  GnssDecoder around({});
  EXPECT_TRUE(decode(around, "t_s,lat_deg,lon_deg,height_m\n0,45,361,100\n").empty());
  EXPECT_EQ(around.error().kind, RowError::Kind::kOutOfRange);
  EXPECT_STREQ(around.error().column.data(), "lon_deg");
}

TEST(CsvGnss, StandardDeviationsThatAreNotPositiveAndSolutionsThatAreInNoListAreNone) {
  GnssDecoder decoder(every_column());
  const auto samples = decode(decoder,
                              "t_s,lat_deg,lon_deg,height_m,vn,ve,vd,sn,se,sd,svn,sve,svd,Q\n"
                              "0.0,45,5,100,1,2,3,0.1,0,0.3,0.4,0.5,-0.6,1\n"
                              "0.2,45,5,100,1,2,3,0.1,0.2,0.3,0.4,0.5,0.6,99\n"
                              "0.4,45,5,100,1,2,3,0.1,0.2,0.3,0.4,0.5,0.6,-1\n");
  ASSERT_EQ(samples.size(), 3U) << describe(decoder.error());
  EXPECT_EQ(samples[0].gnss.flags, kPositionValid | kVelocityValid);
  EXPECT_EQ(samples[1].gnss.solution, GnssSolution::kNone);
  EXPECT_EQ(samples[2].gnss.solution, GnssSolution::kNone);
}

TEST(CsvRecordings, TheRealDriveIsReadRowByRow) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive/02");
  const auto count_lines = [](const test::Bytes& bytes) {
    return std::count(bytes.begin(), bytes.end(), '\n');
  };
  ImuConfig study;
  study.counter_column = "counter";
  study.period = from_seconds(1.0 / 120.0);
  ImuDecoder imu(study);
  const auto imu_bytes = test::load_bytes(test::shared_path("data/car_drive/02/study_imu.csv"));
  test::CollectingSink sink;
  imu.push(imu_bytes, {}, sink);
  imu.finish({}, sink);
  EXPECT_EQ(imu.error().kind, RowError::Kind::kNone) << describe(imu.error());
  EXPECT_EQ(static_cast<std::ptrdiff_t>(sink.samples.size()), count_lines(imu_bytes) - 1);
  EXPECT_EQ(sink.samples[1].imu.omega_radps, (Vector3{-0.003285, -0.000118, -0.006407}));

  GnssDecoder gnss({});
  const auto gnss_bytes = test::load_bytes(test::shared_path("data/car_drive/02/gnss.csv"));
  test::CollectingSink positions;
  gnss.push(gnss_bytes, {}, positions);
  gnss.finish({}, positions);
  EXPECT_EQ(gnss.error().kind, RowError::Kind::kNone) << describe(gnss.error());
  EXPECT_EQ(static_cast<std::ptrdiff_t>(positions.samples.size()), count_lines(gnss_bytes) - 1);
}

}  // namespace
}  // namespace imuscope::csv
