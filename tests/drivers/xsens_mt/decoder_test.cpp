#include "drivers/xsens_mt/decoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/drivers/xsens_mt/mt_frames.h"

namespace imuscope::xsens {
namespace {

using namespace test_frames;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::CollectingSink;

constexpr Duration kPeriod = milliseconds{10};

HostTime host(Duration since_start) { return host_time_from_ns(1'000'000'000'000) + since_start; }

/// Feeds one frame a read, each at its time.
struct Line {
  explicit Line(const MtDecoderConfig& config = {}) : decoder(config) {}
  void send(const Bytes& bytes, Duration at) { decoder.push(bytes, host(at), sink); }
  MtDecoder decoder;
  CollectingSink sink;
};

TEST(MtDecoder, GivesRatesAndForcesInSiAndInTheRotatedAxes) {
  MtDecoderConfig config;
  config.device = 3;
  config.axes = {0, 1, 0, -1, 0, 0, 0, 0, 1};  // a quarter turn about z
  Line line(config);
  line.send(mtdata(17, {1.0, 2.0, 3.0}, {0.25, 0.5, 0.75}), kPeriod);
  ASSERT_EQ(line.sink.samples.size(), 1U);
  const Sample& s = line.sink.samples[0];
  EXPECT_EQ(s.kind, SampleKind::kImu);
  EXPECT_EQ(s.device, 3);
  EXPECT_EQ(s.imu.counter, 17);
  EXPECT_EQ(s.imu.f_mps2, (Vector3{2.0, -1.0, 3.0}));
  EXPECT_EQ(s.imu.omega_radps, (Vector3{0.5, -0.25, 0.75}));
  EXPECT_EQ(s.imu.flags, kGyroValid | kAccelValid);
  EXPECT_EQ(s.arrival, host(kPeriod));
  // 43 bytes at 115200 baud before the read's end; the time of a byte is a whole number of nanoseconds.
  EXPECT_NEAR(to_seconds(s.arrival - s.time), 430.0 / 115200.0, 43 * 0.5e-9);
}

// What a device lists without any inertial item says nothing of the rate, and one of 1 Hz is a rate.
TEST(MtDecoder, AnOutputConfigurationOfNoInertialItemLeavesTheRate) {
  for (const int rate_hz : {0, 1}) {
    MtDecoderConfig config;
    config.rate_hz = 100.0;
    config.clock = ClockMapConfig::fixed(HostTime{}, 1.0);
    Line line(config);
    Bytes taken;
    append(taken, be16(0x1020));
    append(taken, be16(0xFFFF));
    append(taken, be16(rate_hz == 0 ? 0x2010 : 0x4020));
    append(taken, be16(1));
    line.send(frame(0xC1, taken), Duration{});
    for (std::uint16_t i = 0; i < 3; ++i) {
      Bytes data;
      append_item(data, xdi::kPacketCounter, u16(i));
      append_item(data, xdi::kAcceleration, floats({0.5, 0.25, 9.75}));
      line.send(frame(mid::kMtData2, data), kPeriod);
    }
    ASSERT_EQ(line.sink.samples.size(), 3U);
    const double step_s = to_seconds(line.sink.samples[2].time - line.sink.samples[1].time);
    EXPECT_NEAR(step_s, rate_hz == 0 ? 0.01 : 1.0, 1e-6);
  }
}

// Devices with an output configuration report period 1152 (100 Hz) in Configuration, whatever they send.
TEST(MtDecoder, TakesTheRateOfMtData2FromTheOutputConfigurationAndNotFromThePeriod) {
  for (const bool told : {false, true}) {
    SCOPED_TRACE(told);
    MtDecoderConfig config;
    config.rate_hz = told ? 100.0 : 400.0;
    config.clock = ClockMapConfig::fixed(HostTime{}, 1.0);
    Line line(config);
    line.send(configuration(1152, 0, 1, 0, 0, 0), Duration{});
    if (told) {
      Bytes taken;
      for (const auto& [id, rate] : {std::pair<int, int>{0x1020, 0xFFFF},
                                     {0x2010, 100},
                                     {0x4020, 400},
                                     {0x8020, 400},
                                     {0xE020, 0xFFFF}}) {
        append(taken, be16(static_cast<std::uint16_t>(id)));
        append(taken, be16(static_cast<std::uint16_t>(rate)));
      }
      line.send(frame(0xC1, taken), Duration{});
    }
    for (std::uint16_t i = 0; i < 40; ++i) {
      if (i == 30) continue;
      Bytes data;
      append_item(data, 0x1020, u16(i));
      append_item(data, 0x4020, floats({0.1, 0.2, 9.8}));
      append_item(data, 0x8020, floats({0.01, 0.001 * i, 0.0}));
      line.send(frame(mid::kMtData2, data), Duration{});
    }
    ASSERT_EQ(line.sink.samples.size(), 39U);
    EXPECT_EQ(line.decoder.counters().samples_lost, 1U);
    EXPECT_EQ(line.sink.samples.back().time - line.sink.samples.front().time,
              std::chrono::microseconds{39 * 2500});
  }
}

TEST(MtDecoder, UnwrapsTheCounterAndTellsLossFromWrap) {
  Line line;
  const std::array<std::uint16_t, 6> counters{65533, 65534, 65535, 0, 1, 4};
  for (const std::uint16_t c : counters) {
    line.send(mtdata(c), kPeriod * ((c + 65536 - 65533) % 65536));
  }
  ASSERT_EQ(line.sink.samples.size(), 6U);
  EXPECT_EQ(line.sink.samples[5].imu.counter, 65540);
  EXPECT_EQ(line.decoder.counters().samples_lost, 2U);
  EXPECT_EQ(line.decoder.counters().clock_resets, 0U);
  EXPECT_EQ(line.sink.samples[4].imu.flags & kGapBefore, 0U);
  EXPECT_NE(line.sink.samples[5].imu.flags & kGapBefore, 0U);
}

TEST(MtDecoder, HostTimeSaysHowOftenTheCounterWrappedInALongSilence) {
  for (const int turns : {1, 2, 5}) {
    Line line;
    for (int i = 0; i < 100; ++i) line.send(mtdata(static_cast<std::uint16_t>(i)), kPeriod * i);
    const std::int64_t later = 99 + 65536 * turns + 40;
    line.send(mtdata(static_cast<std::uint16_t>(later)), kPeriod * later);
    ASSERT_EQ(line.sink.samples.size(), 101U);
    EXPECT_EQ(line.sink.samples.back().imu.counter, later) << turns;
    EXPECT_EQ(line.decoder.counters().samples_lost, static_cast<std::uint64_t>(later - 100)) << turns;
  }
}

TEST(MtDecoder, ARestartedCounterBeginsANewSegmentAndTimeNeverStepsBack) {
  Line line;
  for (int i = 0; i < 3000; ++i) line.send(mtdata(static_cast<std::uint16_t>(i + 20000)), kPeriod * i);
  for (int i = 0; i < 3000; ++i) line.send(mtdata(static_cast<std::uint16_t>(i)), seconds{32} + kPeriod * i);
  EXPECT_EQ(line.decoder.counters().clock_resets, 1U);
  EXPECT_EQ(line.decoder.counters().bad_contents, 1U);  // the first one could have been a damaged frame
  ASSERT_EQ(line.sink.samples.size(), 5999U);
  for (std::size_t i = 1; i < line.sink.samples.size(); ++i) {
    ASSERT_GT(line.sink.samples[i].time, line.sink.samples[i - 1].time) << i;
    ASSERT_GT(line.sink.samples[i].imu.counter, line.sink.samples[i - 1].imu.counter) << i;
  }
  const Sample& last = line.sink.samples.back();
  EXPECT_NEAR(to_seconds(last.arrival - last.time), 430.0 / 115200.0, 1e-4);
}

TEST(MtDecoder, ADamagedCounterWithARightChecksumIsRefusedAlone) {
  Line line;
  for (int i = 0; i < 200; ++i) {
    const int counter = i == 100 ? i + 30000 : i;
    line.send(mtdata(static_cast<std::uint16_t>(counter)), kPeriod * i);
  }
  EXPECT_EQ(line.sink.samples.size(), 199U);
  EXPECT_EQ(line.decoder.counters().bad_contents, 1U);
  EXPECT_EQ(line.decoder.counters().clock_resets, 0U);
  EXPECT_EQ(line.decoder.counters().samples_lost, 1U);
}

TEST(MtDecoder, AStallOfTheHostIsNeitherLossNorRestart) {
  Line line;
  int next = 0;
  for (; next < 500; ++next) line.send(mtdata(static_cast<std::uint16_t>(next)), kPeriod * next);
  Bytes backlog;  // four seconds of it in one read
  for (; next < 900; ++next) {
    const Bytes frame = mtdata(static_cast<std::uint16_t>(next));
    backlog.insert(backlog.end(), frame.begin(), frame.end());
  }
  line.send(backlog, kPeriod * next);
  for (; next < 1500; ++next) line.send(mtdata(static_cast<std::uint16_t>(next)), kPeriod * next);
  EXPECT_EQ(line.sink.samples.size(), 1500U);
  EXPECT_EQ(line.decoder.counters().samples_lost, 0U);
  EXPECT_EQ(line.decoder.counters().clock_resets, 0U);
  for (std::size_t i = 1; i < line.sink.samples.size(); ++i) {
    ASSERT_NEAR(to_seconds(line.sink.samples[i].time - line.sink.samples[i - 1].time), 0.01, 1e-7) << i;
  }
}

TEST(MtDecoder, LearnsTheLayoutRateAndSkipFactorFromTheConfigurationInTheStream) {
  Line line;
  // Acceleration and rate only, every second sample of 200 Hz.
  line.send(configuration(576, 1, 1, 26, output_mode::kCalibrated,
                          output_settings::kSampleCounter | output_settings::kNoField),
            Duration{});
  for (int i = 0; i < 10; ++i) {
    Bytes data = floats({1, 2, 3, 0.1, 0.2, 0.3});
    append(data, be16(static_cast<std::uint16_t>(2 * i)));
    line.send(frame(mid::kMtData, data), kPeriod * (i + 1));
  }
  ASSERT_EQ(line.sink.samples.size(), 10U);
  EXPECT_EQ(line.sink.samples[9].imu.f_mps2, (Vector3{1, 2, 3}));
  EXPECT_EQ(line.decoder.counters().samples_lost, 0U);
  EXPECT_EQ(line.sink.samples[9].time - line.sink.samples[8].time, kPeriod);
}

TEST(MtDecoder, DataOfAnotherLengthThanTheLayoutIsCountedAndNotGuessed) {
  Line line;
  line.send(frame(mid::kMtData, Bytes(54)), kPeriod);
  EXPECT_TRUE(line.sink.samples.empty());
  EXPECT_EQ(line.decoder.counters().bad_contents, 1U);
  EXPECT_EQ(line.decoder.counters().bytes_skipped, 0U);
}

TEST(MtDecoder, SplitsWhatAnXbusMasterSendsAndDropsADeviceThatFellOffTheBus) {
  MtDecoderConfig config;
  config.bus = {BusDevice{4, {}}, BusDevice{5, {}}, BusDevice{6, {}}};
  for (auto& device : config.bus) device->axes = config.axes;
  Line line(config);
  line.send(configuration(1152, 0, 3, 36, output_mode::kCalibrated, 0, 0x00100456), Duration{});
  constexpr int kMessages = 50;
  for (int i = 0; i < kMessages; ++i) {
    Bytes data = u16(static_cast<std::uint16_t>(i));
    for (int device = 0; device < 3; ++device) {
      const double noise = device == 1 && i >= 20 ? 0.0 : 1e-3 * i;  // device 2 repeats itself from then on
      const Bytes block = floats({device + noise, 0, 9.8, 0.1, 0.2, 0.3, 0.5, 0.5, 0.5});
      data.insert(data.end(), block.begin(), block.end());
    }
    line.send(frame(mid::kMtData, data), kPeriod * (i + 1));
  }
  std::array<int, 7> n{};
  for (const Sample& s : line.sink.samples) {
    ++n[s.device];
    EXPECT_NEAR(s.imu.f_mps2[0], s.device - 4, 0.06);
  }
  EXPECT_EQ(n[4], kMessages);
  EXPECT_EQ(n[6], kMessages);
  EXPECT_EQ(n[5], 23);  // 20 of its own, and three before the repetition is certain
}

TEST(MtDecoder, AFixedClockNeedsNoArrivalsAndBackDatesNothing) {
  MtDecoderConfig config;
  config.clock = ClockMapConfig::fixed(host(Duration{}), 1.0 + 20e-6);
  Line line(config);
  for (int i = 0; i < 1000; ++i) line.send(mtdata(static_cast<std::uint16_t>(i)), Duration{});
  ASSERT_EQ(line.sink.samples.size(), 1000U);
  const Sample& last = line.sink.samples.back();
  EXPECT_EQ(last.time, host(Duration{static_cast<std::int64_t>(9.99e9 * (1.0 + 20e-6))}));
  EXPECT_NEAR(to_seconds(last.arrival - last.time), 430.0 / 115200.0, 1e-7);
}

/// One MTData2 message with inertial data.
Bytes inertial(std::uint16_t count, std::uint32_t ticks, std::uint32_t status = 0) {
  Bytes data;
  append_item(data, xdi::kPacketCounter, u16(count));
  append_item(data, xdi::kSampleTimeFine, u32(ticks));
  append_item(data, xdi::kAcceleration, floats({0.5, 0.25, 9.75}));
  append_item(data, xdi::kRateOfTurn, floats({0.125, -0.5, 1.0}));
  append_item(data, xdi::kStatusWord, u32(status));
  return frame(mid::kMtData2, data);
}

TEST(MtDecoder, GnssMessagesThatShareThePacketCounterAreNoLoss) {
  Line line;
  std::uint16_t count = 65500;
  for (int i = 0; i < 400; ++i) {
    line.send(inertial(count++, static_cast<std::uint32_t>(1000 + 100 * i)), kPeriod * i);
    if (i % 25 != 3) continue;
    Bytes gnss;
    append_item(gnss, xdi::kPacketCounter, u16(count++));
    append_item(gnss, 0x7010, Bytes(kGnssPvtSize));
    line.send(frame(mid::kMtData2, gnss), kPeriod * i + milliseconds{2});
  }
  EXPECT_EQ(line.sink.samples.size(), 400U);
  EXPECT_EQ(line.decoder.counters().samples_lost, 0U);
  for (std::size_t i = 1; i < line.sink.samples.size(); ++i) {
    ASSERT_EQ(line.sink.samples[i].imu.counter, line.sink.samples[i - 1].imu.counter + 1);
    ASSERT_EQ(line.sink.samples[i].time - line.sink.samples[i - 1].time, kPeriod) << i;
  }
}

TEST(MtDecoder, SampleTimeFineWrapsAtADayOrAtThirtyTwoBits) {
  for (const std::int64_t wrap : {kSampleTimeFineDay, kSampleTimeFineModulus}) {
    Line line;
    for (int i = 0; i < 20; ++i) {
      const std::int64_t ticks = (wrap - 1000 + 100 * i) % wrap;
      line.send(inertial(static_cast<std::uint16_t>(i), static_cast<std::uint32_t>(ticks)), kPeriod * i);
    }
    ASSERT_EQ(line.sink.samples.size(), 20U) << wrap;
    EXPECT_EQ(line.decoder.counters().samples_lost, 0U) << wrap;
    EXPECT_EQ(line.decoder.counters().clock_resets, 0U) << wrap;
    EXPECT_EQ(line.sink.samples[19].time - line.sink.samples[0].time, 19 * kPeriod) << wrap;
  }
}

TEST(MtDecoder, WhatADeviceDoesNotMeasureWhileItIsSetUpIsAGapAndNoLoss) {
  for (const bool mtdata2 : {false, true}) {
    Line line;
    const auto send = [&](int i) {
      const auto count = static_cast<std::uint16_t>(i);
      line.send(mtdata2 ? inertial(count, static_cast<std::uint32_t>(100 * i)) : mtdata(count), kPeriod * i);
    };
    for (int i = 0; i < 20; ++i) send(i);
    line.send(frame(mid::reply_to(mid::kGoToConfig)), kPeriod * 20);
    line.send(frame(mid::reply_to(mid::kGoToMeasurement)), kPeriod * 31);
    for (int i = 32; i < 40; ++i) send(i);
    EXPECT_EQ(line.decoder.counters().samples_lost, 0U);
    ASSERT_EQ(line.sink.samples.size(), 28U);
    EXPECT_NE(line.sink.samples[20].imu.flags & kGapBefore, 0U);
    EXPECT_EQ(line.sink.samples[20].imu.counter, 32);
    // The pause is over: what is missing now is lost.
    send(45);
    EXPECT_EQ(line.decoder.counters().samples_lost, 5U);
  }
}

TEST(MtDecoder, LostMessagesAreCountedByTheSampleTime) {
  Line line;
  for (const int i : {0, 1, 2, 6, 7}) {
    line.send(inertial(static_cast<std::uint16_t>(i), static_cast<std::uint32_t>(100 * i)), kPeriod * i);
  }
  EXPECT_EQ(line.decoder.counters().samples_lost, 3U);
  EXPECT_NE(line.sink.samples[3].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(line.sink.samples[4].imu.flags & kGapBefore, 0U) << "before this one nothing is missing";
  EXPECT_EQ(line.sink.samples[4].imu.counter, 7);
}

TEST(MtDecoder, ATemperatureIsOfTheSampleItCameWithInBothFormats) {
  MtDecoderConfig config;
  config.layout = {output_mode::kTemperature | output_mode::kCalibrated,
                   output_settings::kSampleCounter | output_settings::kNoField};
  Line legacy(config);
  Bytes data = floats({31.5, 0.1, 0.2, 9.8, 0.01, 0.02, 0.03});
  append(data, be16(std::uint16_t{7}));
  legacy.send(frame(mid::kMtData, data), Duration{});
  ASSERT_EQ(legacy.sink.samples.size(), 1U);
  EXPECT_EQ(legacy.sink.samples[0].imu.flags, kGyroValid | kAccelValid | kHasTemperature);
  EXPECT_EQ(legacy.sink.samples[0].imu.temperature_degC, 31.5F);
  EXPECT_EQ(legacy.sink.samples[0].imu.omega_radps[2], static_cast<double>(0.03F));

  // MTData2 sends it at a rate of its own.
  Line line;
  for (const bool with : {false, true, false}) {
    Bytes items;
    append_item(items, xdi::kAcceleration, floats({0.1, 0.2, 9.8}));
    if (with) append_item(items, xdi::kTemperature, floats({42.25}));
    append_item(items, xdi::kRateOfTurn, floats({0.01, 0.02, 0.03}));
    line.send(frame(mid::kMtData2, items), kPeriod * static_cast<int>(line.sink.samples.size()));
  }
  ASSERT_EQ(line.sink.samples.size(), 3U);
  EXPECT_EQ(line.sink.samples[0].imu.flags & kHasTemperature, 0U);
  EXPECT_NE(line.sink.samples[1].imu.flags & kHasTemperature, 0U);
  EXPECT_EQ(line.sink.samples[1].imu.temperature_degC, 42.25F);
  EXPECT_EQ(line.sink.samples[2].imu.flags & kHasTemperature, 0U);
}

TEST(MtDecoder, ClippedAxesAreFlagged) {
  Line line;
  line.send(inertial(0, 0, 1U << 9U | 1U << 13U), Duration{});
  EXPECT_EQ(line.sink.samples[0].imu.flags, kGyroValid | kAccelValid | kAccelClipY | kGyroClipZ);
}

TEST(MtDecoder, IncrementsBecomeMeansOverTheirInterval) {
  Line line;
  const double angle = 0.02;  // about y, in 10 ms
  for (int i = 0; i < 3; ++i) {
    Bytes data;
    append_item(data, xdi::kSampleTimeFine, u32(static_cast<std::uint32_t>(100 * i)));
    append_item(data, xdi::kDeltaV, floats({0.01, 0.0, 0.098}));
    append_item(data, xdi::kDeltaQ, floats({-std::cos(angle / 2), 0.0, -std::sin(angle / 2), 0.0}));
    line.send(frame(mid::kMtData2, data), kPeriod * i);
  }
  const ImuData& imu = line.sink.samples[2].imu;
  EXPECT_EQ(imu.flags, kGyroValid | kAccelValid | kIsIncrement);
  EXPECT_NEAR(imu.omega_radps[1], angle / 0.01, 1e-5);  // float32 quaternion
  EXPECT_NEAR(imu.f_mps2[2], 9.8, 1e-5);
}

TEST(MtDecoder, OneDeviceOfSeveralBehindAnXbusMasterIsPickedOutByItsBusId) {
  MtDecoderConfig config;
  config.bus.resize(3);
  config.bus[1] = BusDevice{7, {0, 1, 0, -1, 0, 0, 0, 0, 1}};
  Line line(config);
  for (int i = 0; i < 5; ++i) {
    Bytes data = u16(static_cast<std::uint16_t>(i));
    for (int device = 0; device < 3; ++device) {
      const Bytes block = mtdata(static_cast<std::uint16_t>(i), {device + 0.5, 0.001 * i, 9.8});
      data.insert(data.end(), block.begin() + 4, block.end() - 1);
    }
    line.send(frame(mid::kMtData, data), kPeriod * (i + 1));
  }
  ASSERT_EQ(line.sink.samples.size(), 5U);
  for (const Sample& s : line.sink.samples) {
    EXPECT_EQ(s.device, 7);
    EXPECT_NEAR(s.imu.f_mps2[1], -1.5, 1e-6);  // turned by its own axes
  }
}

/// Attitude of a body that is first turned by heading, then pitched, then rolled: Rz Ry Rx, as a quaternion.
std::array<double, 4> quaternion_of(double roll, double pitch, double heading) {
  const double cr = std::cos(roll / 2), sr = std::sin(roll / 2);
  const double cp = std::cos(pitch / 2), sp = std::sin(pitch / 2);
  const double ch = std::cos(heading / 2), sh = std::sin(heading / 2);
  return {cr * cp * ch + sr * sp * sh, sr * cp * ch - cr * sp * sh, cr * sp * ch + sr * cp * sh,
          cr * cp * sh - sr * sp * ch};
}

TEST(MtDecoder, OrientationInEachLocalFrameBecomesTheSameRollAndPitchWithoutAHeading) {
  constexpr double kRoll = 0.1, kPitch = -0.2, kHeading = 1.1;
  // In north-east-down the device's axes are forward-right-down. In the other two local frames the same
  // device is described by axes forward-left-up, which the configuration turns.
  const Matrix3 flu_to_frd{1, 0, 0, 0, -1, 0, 0, 0, -1};
  struct Case {
    std::uint16_t frame_bits;
    std::array<double, 4> q;
    Matrix3 axes;
  };
  const Case cases[] = {
      {0x4, quaternion_of(kRoll, kPitch, kHeading), {1, 0, 0, 0, 1, 0, 0, 0, 1}},
      // FLU in north-west-up: the y and z components change sign.
      {0x8, quaternion_of(kRoll, -kPitch, -kHeading), flu_to_frd},
      // East-north-up: north-west-up turned by a quarter.
      {0x0, quaternion_of(kRoll, -kPitch, kPi / 2 - kHeading), flu_to_frd},
  };
  for (const Case& c : cases) {
    MtDecoderConfig config;
    config.wants_attitude = true;
    config.axes = c.axes;
    Line line(config);
    Bytes data;
    append_item(data, xdi::kSampleTimeFine, u32(1000));
    append_item(data, static_cast<std::uint16_t>(xdi::kQuaternion | c.frame_bits),
                floats({c.q[0], c.q[1], c.q[2], c.q[3]}));
    append_item(data, xdi::kAcceleration, floats({0, 0, 9.8}));
    append_item(data, xdi::kRateOfTurn, floats({0, 0, 0}));
    append_item(data, xdi::kStatusWord, u32(kStatusFilterValid));
    line.send(frame(mid::kMtData2, data), kPeriod);
    const auto attitude = line.sink.of_kind(SampleKind::kAttitude);
    ASSERT_EQ(attitude.size(), 1U) << c.frame_bits;
    EXPECT_NEAR(attitude[0].attitude.roll_rad, kRoll, 1e-6) << c.frame_bits;
    EXPECT_NEAR(attitude[0].attitude.pitch_rad, kPitch, 1e-6) << c.frame_bits;
    EXPECT_NEAR(attitude[0].attitude.heading_rad, kHeading, 1e-6) << c.frame_bits;
    EXPECT_EQ(attitude[0].attitude.flags, kRollPitchValid);
    EXPECT_EQ(line.sink.of_kind(SampleKind::kImu).size(), 1U);
  }
}

TEST(MtDecoder, AMatrixIsReadByColumnsAndAnUnsettledFilterGivesNoAttitude) {
  MtDecoderConfig config;
  config.wants_attitude = true;
  Line line(config);
  const double a = 0.3;  // roll alone: R = [1 0 0; 0 c -s; 0 s c]
  for (const std::uint32_t status : {kStatusFilterValid, 0U}) {
    Bytes data;
    append_item(data, 0x2024, floats({1, 0, 0, 0, std::cos(a), std::sin(a), 0, -std::sin(a), std::cos(a)}));
    append_item(data, xdi::kAcceleration, floats({0, 0, 9.8}));
    append_item(data, xdi::kRateOfTurn, floats({0, 0, 0}));
    append_item(data, xdi::kStatusByte, {static_cast<std::uint8_t>(status)});
    line.send(frame(mid::kMtData2, data), kPeriod);
  }
  const auto attitude = line.sink.of_kind(SampleKind::kAttitude);
  ASSERT_EQ(attitude.size(), 2U);
  EXPECT_NEAR(attitude[0].attitude.roll_rad, a, 1e-6);
  EXPECT_EQ(attitude[0].attitude.flags, kRollPitchValid);
  EXPECT_EQ(attitude[1].attitude.flags, 0U);
}

TEST(MtDecoder, AReceiverInsideGivesSolutionsWithUtcAndItsRtkState) {
  MtDecoderConfig config;
  config.wants_imu = false;
  config.wants_gnss = true;
  Line line(config);
  Bytes pvt(kGnssPvtSize, 0);
  const auto put = [&](std::size_t at, std::uint32_t value) {
    const auto bytes = be32(value);
    std::copy(bytes.begin(), bytes.end(), pvt.begin() + static_cast<std::ptrdiff_t>(at));
  };
  put(0, 400'000'000);
  pvt[4] = 2026 >> 8, pvt[5] = 2026 & 0xFF, pvt[6] = 3, pvt[7] = 14;
  pvt[8] = 12, pvt[9] = 34, pvt[10] = 56, pvt[11] = 7;
  put(16, static_cast<std::uint32_t>(-1000));
  pvt[20] = 3, pvt[21] = 0x03;
  put(24, 23'522'190), put(28, 488'566'140), put(32, 81'500), put(40, 14), put(44, 20);
  put(48, 1250), put(52, static_cast<std::uint32_t>(-500)), put(68, 50);
  for (int i = 0; i < 3; ++i) {
    Bytes data;
    append_item(data, xdi::kPacketCounter, u16(static_cast<std::uint16_t>(i)));
    append_item(data, xdi::kGnssPvt, pvt);
    append_item(data, xdi::kStatusWord, u32(2U << 27U));
    line.send(frame(mid::kMtData2, data), kPeriod * (i + 1));  // the same epoch three times
  }
  ASSERT_EQ(line.sink.samples.size(), 1U);
  const Sample& s = line.sink.samples[0];
  EXPECT_EQ(s.gnss.solution, GnssSolution::kFixed);
  EXPECT_NEAR(s.gnss.latitude_rad / kRadPerDeg, 48.856614, 1e-12);
  EXPECT_NEAR(s.gnss.longitude_rad / kRadPerDeg, 2.352219, 1e-12);
  EXPECT_EQ(s.gnss.v_n_mps, (Vector3{1.25, -0.5, 0.0}));
  const UtcTime day = std::chrono::sys_days{std::chrono::year{2026} / 3 / 14};
  EXPECT_EQ(s.utc, day + std::chrono::seconds{45296} - std::chrono::microseconds{1});
}

TEST(MtDecoder, TheReceiversSolutionKeepsEveryNumber) {
  const GnssPvt pvt{.time_of_week_ms = 400'000'250,
                    .year = 2026,
                    .month = 3,
                    .day = 14,
                    .hour = 12,
                    .minute = 34,
                    .second = 56,
                    .valid = 0x37,
                    .time_accuracy_ns = 25,
                    .nanoseconds = -125,
                    .fix_type = 4,
                    .flags = 0xFF,
                    .n_satellites = 17,
                    .reserved = 99,
                    .longitude_1e7_deg = -66'000'001,
                    .latitude_1e7_deg = 465'000'002,
                    .height_mm = 450'003,
                    .height_msl_mm = 400'004,
                    .horizontal_accuracy_mm = 15,
                    .vertical_accuracy_mm = 26,
                    .velocity_ned_mmps = {1001, -1002, 1003},
                    .ground_speed_mmps = 1417,
                    .course_1e5_deg = 31'500'018,
                    .speed_accuracy_mmps = 79,
                    .course_accuracy_1e5_deg = 180'020,
                    .vehicle_heading_1e5_deg = 21,
                    .dop_centi = {1, 2, 3, 4, 5, 6, 7}};
  const NavPvt nav = nav_pvt_of(pvt, 2);
  const std::vector<std::int64_t> found{
      nav.itow, nav.year,  nav.month,  nav.day, nav.hour, nav.minute, nav.sec, nav.valid, nav.tacc, nav.nano,
      nav.fix,  nav.flags, nav.flags2, nav.nsv, nav.lon,  nav.lat,    nav.h,   nav.hmsl,  nav.hacc, nav.vacc,
      nav.vn,   nav.ve,    nav.vd,     nav.gs,  nav.hm,   nav.sacc,   nav.hda, nav.pdop};
  const std::vector<std::int64_t> expected{400'000'250, 2026,        3,       14,         12,   34,      56,
                                           0x37,        25,          -125,    4,          0x83, 0,       17,
                                           -66'000'001, 465'000'002, 450'003, 400'004,    15,   26,      1001,
                                           -1002,       1003,        1417,    31'500'018, 79,   180'020, 2};
  EXPECT_EQ(found, expected);
}

/// Status byte, counter and, where wanted, UTC after the orientation of a legacy message.
Bytes legacy_orientation(const Bytes& orientation, std::uint8_t status, std::uint16_t counter) {
  Bytes data = orientation;
  data.push_back(status);
  append(data, be16(counter));
  return frame(mid::kMtData, data);
}

TEST(MtDecoder, LegacyOrientationBecomesAttitudeInEachFormAndLocalFrame) {
  constexpr double kRoll = 0.1, kPitch = -0.2, kHeading = 1.1;
  constexpr std::uint8_t kValid = 0x02;
  const auto attitude_of_form = [&](std::uint32_t form, const Bytes& orientation, std::uint8_t status) {
    MtDecoderConfig config;
    config.wants_attitude = true;
    config.layout = {output_mode::kOrientation | output_mode::kStatus,
                     form | output_settings::kSampleCounter | output_settings::kNorthEastDown};
    Line line(config);
    line.send(legacy_orientation(orientation, status, 5), kPeriod);
    EXPECT_TRUE(line.sink.of_kind(SampleKind::kImu).empty()) << "neither rates nor forces came";
    return line.sink.of_kind(SampleKind::kAttitude).at(0).attitude;
  };
  const auto q = quaternion_of(kRoll, kPitch, kHeading);
  // Column by column, R = Rz(heading) Ry(pitch) Rx(roll).
  const double cr = std::cos(kRoll), sr = std::sin(kRoll), cp = std::cos(kPitch), sp = std::sin(kPitch);
  const double ch = std::cos(kHeading), sh = std::sin(kHeading);
  const Bytes matrix = floats({ch * cp, sh * cp, -sp, ch * sp * sr - sh * cr, sh * sp * sr + ch * cr, cp * sr,
                               ch * sp * cr + sh * sr, sh * sp * cr - ch * sr, cp * cr});
  const Bytes euler = floats({kRoll / kRadPerDeg, kPitch / kRadPerDeg, kHeading / kRadPerDeg});
  const Bytes quaternion = floats({q[0], q[1], q[2], q[3]});
  for (const auto& [form, bytes] :
       {std::pair{output_settings::kQuaternion, quaternion}, std::pair{output_settings::kEuler, euler},
        std::pair{output_settings::kMatrix, matrix}}) {
    const AttitudeData attitude = attitude_of_form(form, bytes, kValid);
    EXPECT_NEAR(attitude.roll_rad, kRoll, 1e-6) << form;
    EXPECT_NEAR(attitude.pitch_rad, kPitch, 1e-6) << form;
    EXPECT_NEAR(attitude.heading_rad, kHeading, 1e-6) << form;
    EXPECT_EQ(attitude.flags, kRollPitchValid) << form;
  }
  EXPECT_EQ(attitude_of_form(output_settings::kEuler, euler, 0).flags, 0U) << "its filter has not settled";
  EXPECT_EQ(attitude_of_form(output_settings::kEuler, floats({NAN, 0.0, 0.0}), kValid).flags, 0U);

  // North-west-up where the setting does not say otherwise: the same numbers are another attitude.
  MtDecoderConfig config;
  config.wants_attitude = true;
  config.axes = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  config.layout = {output_mode::kOrientation | output_mode::kStatus,
                   output_settings::kEuler | output_settings::kSampleCounter};
  Line line(config);
  line.send(legacy_orientation(floats({kRoll / kRadPerDeg, -kPitch / kRadPerDeg, -kHeading / kRadPerDeg}),
                               kValid, 5),
            kPeriod);
  const auto up = line.sink.of_kind(SampleKind::kAttitude).at(0).attitude;
  EXPECT_NEAR(up.roll_rad, kRoll, 1e-6);
  EXPECT_NEAR(up.pitch_rad, kPitch, 1e-6);
  EXPECT_NEAR(up.heading_rad, kHeading, 1e-6);
}

/// Data of an MTi-G: the receiver's solution, the status byte, the counter.
Bytes mtig(std::uint32_t itow_ms, std::uint8_t status, std::uint16_t counter) {
  Bytes data = u16(0);  // pressure
  data.push_back(0);
  for (const std::int32_t value :
       {static_cast<std::int32_t>(itow_ms), 488'566'140, 23'522'190, 81'500, 125, -50, -25, 1400, 2000, 7}) {
    append(data, be32(static_cast<std::uint32_t>(value)));
  }
  data.push_back(0);
  data.push_back(status);
  append(data, be16(counter));
  return frame(mid::kMtData, data);
}

TEST(MtDecoder, TheReceiverOfAnMtiGGivesEachSolutionOnceInSi) {
  MtDecoderConfig config;
  config.wants_imu = false;
  config.wants_gnss = true;
  config.layout = {output_mode::kGpsPvt | output_mode::kStatus, output_settings::kSampleCounter};
  Line line(config);
  constexpr std::uint8_t kFix = 0x04;
  std::uint16_t counter = 0;
  for (const std::uint32_t itow_ms : {1000U, 1000U, 1250U}) {
    line.send(mtig(itow_ms, kFix, counter), kPeriod * counter);
    ++counter;
  }
  line.send(mtig(1500, 0, counter), kPeriod * counter);
  ASSERT_EQ(line.sink.samples.size(), 3U);
  const GnssData& gnss = line.sink.samples[0].gnss;
  EXPECT_EQ(gnss.solution, GnssSolution::kSingle);
  EXPECT_NEAR(gnss.latitude_rad / kRadPerDeg, 48.856614, 1e-12);
  EXPECT_NEAR(gnss.longitude_rad / kRadPerDeg, 2.352219, 1e-12);
  EXPECT_DOUBLE_EQ(gnss.height_m, 81.5);
  EXPECT_EQ(gnss.v_n_mps, (Vector3{1.25, -0.5, -0.25}));
  EXPECT_NEAR(gnss.sd_position_m[0], 1.4 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(gnss.sd_position_m[2], 2.0, 1e-12);
  EXPECT_NEAR(gnss.sd_velocity_mps[0], 0.07 / std::sqrt(3.0), 1e-12);
  EXPECT_FALSE(line.sink.samples[0].has_utc) << "the message has no date";
  EXPECT_EQ(line.sink.samples[2].gnss.solution, GnssSolution::kNone) << "the status byte says: no fix";
}

TEST(MtDecoder, UtcOfALegacyMessageIsTakenWhereItIsValidAndPossible) {
  const auto utc_of_message = [](std::initializer_list<std::pair<std::size_t, int>> changes) {
    MtDecoderConfig config;
    config.layout = {output_mode::kCalibrated,
                     output_settings::kSampleCounter | output_settings::kUtcTime | output_settings::kNoField};
    Line line(config);
    Bytes data = floats({0.1, 0.2, 9.8, 0.01, 0.02, 0.03});
    append(data, be16(std::uint16_t{7}));
    Bytes utc = u32(250'000'000);
    append(utc, be16(std::uint16_t{2026}));
    utc.insert(utc.end(), {3, 14, 12, 34, 56, 0x07});
    for (const auto& [at, value] : changes) utc[at] = static_cast<std::uint8_t>(value);
    data.insert(data.end(), utc.begin(), utc.end());
    line.send(frame(mid::kMtData, data), kPeriod);
    return line.sink.samples.at(0);
  };
  constexpr std::size_t kMonthAt = 6, kHourAt = 8, kMinuteAt = 9, kSecondAt = 10, kFlagsAt = 11;
  const Sample good = utc_of_message({});
  const UtcTime day = std::chrono::sys_days{std::chrono::year{2026} / 3 / 14};
  ASSERT_TRUE(good.has_utc);
  EXPECT_EQ(good.utc, day + seconds{45296} + milliseconds{250});
  EXPECT_EQ(good.imu.counter, 7) << "the counter stands before the time";
  for (const auto& [at, value] :
       {std::pair{kMonthAt, 13}, std::pair{kHourAt, 24}, std::pair{kMinuteAt, 60}, std::pair{kSecondAt, 61},
        std::pair{kFlagsAt, 0}, std::pair{std::size_t{0}, 0xFF}}) {
    EXPECT_FALSE(utc_of_message({{at, value}}).has_utc) << at;
  }
}

TEST(MtDecoder, ItemsOfTheFastOutputAreTakenWhereTheUsualOnesAreMissing) {
  Line line;
  for (const bool usual : {false, true}) {
    Bytes data;
    append_item(data, xdi::kAccelerationHr, floats({1, 2, 3}));
    append_item(data, xdi::kRateOfTurnHr, floats({0.25, 0.5, 0.75}));
    if (usual) {
      data.clear();
      append_item(data, xdi::kAcceleration, floats({4, 5, 6}));
      append_item(data, xdi::kRateOfTurn, floats({1.25, 1.5, 1.75}));
      append_item(data, xdi::kAccelerationHr, floats({1, 2, 3}));
      append_item(data, xdi::kRateOfTurnHr, floats({0.25, 0.5, 0.75}));
    }
    line.send(frame(mid::kMtData2, data), kPeriod * static_cast<int>(line.sink.samples.size()));
  }
  ASSERT_EQ(line.sink.samples.size(), 2U);
  EXPECT_EQ(line.sink.samples[0].imu.f_mps2, (Vector3{1, 2, 3}));
  EXPECT_EQ(line.sink.samples[0].imu.omega_radps, (Vector3{0.25, 0.5, 0.75}));
  EXPECT_EQ(line.sink.samples[1].imu.f_mps2, (Vector3{4, 5, 6}));
  EXPECT_EQ(line.sink.samples[1].imu.omega_radps, (Vector3{1.25, 1.5, 1.75}));
}

TEST(MtDecoder, AMessageThatCameTwiceGivesOneSample) {
  Line line;
  for (const int i : {0, 1, 1, 2}) {
    line.send(inertial(static_cast<std::uint16_t>(i), static_cast<std::uint32_t>(100 * i)), kPeriod * i);
  }
  EXPECT_EQ(line.sink.samples.size(), 3U);
  EXPECT_EQ(line.decoder.counters().bad_contents, 1U);
  EXPECT_EQ(line.decoder.counters().samples_lost, 0U);

  Line counted;  // by the message counter alone
  for (const int i : {0, 1, 1, 2}) {
    Bytes data;
    append_item(data, xdi::kPacketCounter, u16(static_cast<std::uint16_t>(i)));
    append_item(data, xdi::kAcceleration, floats({0.5, 0.25, 9.75}));
    append_item(data, xdi::kRateOfTurn, floats({0.125, -0.5, 1.0}));
    counted.send(frame(mid::kMtData2, data), kPeriod * i);
  }
  EXPECT_EQ(counted.sink.samples.size(), 3U);
  EXPECT_EQ(counted.decoder.counters().bad_contents, 1U);
}

TEST(MtDecoder, ARestartOfTheSampleTimeInADumpBeginsANewSegment) {
  // Without host time a step back, or one of hours forward, can only be a restart.
  for (const std::uint32_t behind : {100U, 500'000'000U}) {
    MtDecoderConfig config;
    config.clock = ClockMapConfig::fixed(host(Duration{}), 1.0);
    Line line(config);
    std::uint16_t count = 0;
    for (const std::uint32_t ticks : {100'000U, 100'100U, behind, behind + 100U}) {
      line.send(inertial(count++, ticks), Duration{});
    }
    ASSERT_EQ(line.sink.samples.size(), 4U) << behind;
    EXPECT_EQ(line.decoder.counters().clock_resets, 1U) << behind;
    EXPECT_EQ(line.decoder.counters().samples_lost, 0U) << behind;
    EXPECT_NE(line.sink.samples[2].imu.flags & kGapBefore, 0U) << behind;
    EXPECT_GT(line.sink.samples[2].time, line.sink.samples[1].time) << behind;
    EXPECT_EQ(line.sink.samples[3].time - line.sink.samples[2].time, kPeriod) << behind;
  }
}

TEST(MtDecoder, AConfigurationThatContradictsItselfIsCountedAndNotTaken) {
  Line line;
  line.send(configuration(1152, 0, 1, 99, output_mode::kCalibrated, output_settings::kSampleCounter),
            Duration{});
  EXPECT_EQ(line.decoder.counters().bad_contents, 1U);
  line.send(frame(mid::kConfiguration, Bytes(20)), Duration{});
  EXPECT_EQ(line.decoder.counters().bad_contents, 2U);
  line.send(mtdata(1), kPeriod);
  EXPECT_EQ(line.sink.samples.size(), 1U) << "the layout is still the one before";
}

TEST(MtDecoder, AnItemBeyondTheEndMakesTheWholeMessageInvalid) {
  Line line;
  Bytes data;
  append_item(data, xdi::kAcceleration, floats({1, 2, 3}));
  data.insert(data.end(), {0x80, 0x20, 12, 0, 0});
  line.send(frame(mid::kMtData2, data), Duration{});
  EXPECT_TRUE(line.sink.samples.empty());
  EXPECT_EQ(line.decoder.counters().bad_contents, 1U);
}

TEST(MtDecoder, AnErrorMessageIsKept) {
  Line line;
  EXPECT_FALSE(line.decoder.last_error());
  line.send(frame(mid::kError, {0x29}), Duration{});
  EXPECT_EQ(line.decoder.last_error(), 0x29);
  EXPECT_NE(error_text(0x29).find("baud rate"), std::string_view::npos);
  EXPECT_EQ(line.decoder.remark(), error_text(0x29));
  line.send(frame(mid::kError), Duration{});
  EXPECT_EQ(line.decoder.last_error(), 0x29) << "an error without a number says nothing new";
  line.send(frame(mid::kError, {0xEE}), Duration{});
  EXPECT_FALSE(line.decoder.remark().empty()) << "a number that is in no list";
}

}  // namespace
}  // namespace imuscope::xsens
