// Telegrams to samples: units, axes, time, alignment, raw blocks that cannot be used, losses.
#include "drivers/ixblue_stdbin/decoder.h"

#include <gtest/gtest.h>
#include <cmath>

#include "base/units.h"
#include "drivers/ixblue_stdbin/session.h"
#include "tests/drivers/ixblue_stdbin/telegram_builder.h"
#include "tests/support/shared_data.h"

namespace imuscope::ixblue_stdbin {
namespace {

using test::Bytes;
using test::TelegramBuilder;
using namespace std::chrono_literals;

constexpr std::uint32_t kReadyStatus = kUserTimeReceived;

/// A telegram like a unit's at 100 Hz: raw blocks with changing values, status, date.
TelegramBuilder telegram(std::uint32_t i, std::uint32_t validity_ticks) {
  const float noise = 0.001F * static_cast<float>(i % 97);
  TelegramBuilder builder(3, i, validity_ticks);
  builder.nav(0, TelegramBuilder::floats({10.0F, 2.0F, 3.0F}))
      .nav(13, TelegramBuilder::date(14, 3, 2026))
      .nav(17, TelegramBuilder::word(kReadyStatus))
      .nav(28, TelegramBuilder::floats({0.1F + noise, 0.2F, 9.8F}))
      .extended(2, TelegramBuilder::floats({1.0F + noise, 2.0F, 3.0F}));
  return builder;
}

DecoderConfig fixed_config() {
  DecoderConfig config;
  config.device = 3;
  config.clock = ClockMapConfig::fixed(host_time_from_ns(0), 1.0);
  return config;
}

struct Rig {
  explicit Rig(const DecoderConfig& config = fixed_config()) : decoder(config) {}
  void push(const TelegramBuilder& builder) { decoder.push(builder.build(), {}, sink); }
  Decoder decoder;
  test::CollectingSink sink;
};

TEST(StdBinDecoder, RawBlocksBecomeRatesAndForcesInForwardRightDown) {
  Rig rig;
  rig.push(TelegramBuilder(3, 5, 1000)
               .nav(28, TelegramBuilder::floats({0.5F, 0.25F, 9.75F}))
               .extended(0, TelegramBuilder::floats({10.0F, 20.0F, 30.0F}))
               .extended(2, TelegramBuilder::floats({1.0F, 2.0F, 3.0F})));
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const Sample& sample = rig.sink.samples[0];
  EXPECT_EQ(sample.kind, SampleKind::kImu);
  EXPECT_EQ(sample.device, 3);
  EXPECT_EQ(to_ns(sample.time), 100'000'000);
  EXPECT_FALSE(sample.has_utc);
  // Forward stays, port becomes minus right, up becomes minus down.
  EXPECT_DOUBLE_EQ(sample.imu.omega_radps[0], 1.0 * kPi / 180.0);
  EXPECT_DOUBLE_EQ(sample.imu.omega_radps[1], -2.0 * kPi / 180.0);
  EXPECT_DOUBLE_EQ(sample.imu.omega_radps[2], -3.0 * kPi / 180.0);
  EXPECT_EQ(sample.imu.f_mps2, (Vector3{0.5, -0.25, -9.75}));
  EXPECT_DOUBLE_EQ(sample.imu.angular_acceleration_radps2[1], -20.0 * kPi / 180.0);
  EXPECT_EQ(sample.imu.flags, kGyroValid | kAccelValid | kHasAngularAcceleration);
  EXPECT_EQ(sample.imu.counter, 5);
}

TEST(StdBinDecoder, TheConfiguredAxesTakeTheUnitToTheVehicle) {
  DecoderConfig config = fixed_config();
  config.axes = {0, 1, 0, 1, 0, 0, 0, 0, -1};  // unit turned a quarter: b = (port, forward, -up) of the unit
  Rig rig(config);
  rig.push(TelegramBuilder(3, 5, 1000)
               .nav(28, TelegramBuilder::floats({0.5F, 0.25F, 9.75F}))
               .extended(2, TelegramBuilder::floats({1.0F, 2.0F, 3.0F})));
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  EXPECT_EQ(rig.sink.samples[0].imu.f_mps2, (Vector3{0.25, 0.5, -9.75}));
}

TEST(StdBinDecoder, AttitudeIsOfForwardRightDownWithPitchNoseUp) {
  Rig rig;
  rig.push(TelegramBuilder(3, 5, 1000)
               .nav(0, TelegramBuilder::floats({350.0F, 2.0F, 3.0F}))
               .nav(1, TelegramBuilder::floats({0.5F, 0.02F, 0.03F}))
               .nav(17, TelegramBuilder::word(kReadyStatus)));
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const AttitudeData& attitude = rig.sink.samples[0].attitude;
  EXPECT_EQ(rig.sink.samples[0].kind, SampleKind::kAttitude);
  EXPECT_NEAR(attitude.heading_rad, 350.0 * kRadPerDeg, 1e-12);
  EXPECT_NEAR(attitude.roll_rad, 2.0 * kRadPerDeg, 1e-12);    // port side up = right side down
  EXPECT_NEAR(attitude.pitch_rad, -3.0 * kRadPerDeg, 1e-12);  // bow down
  EXPECT_NEAR(attitude.sd_rpy_rad[2], 0.5 * kRadPerDeg, 1e-9);
  EXPECT_EQ(attitude.flags, kRollPitchValid | kHeadingValid | kHasAttitudeSd);
}

TEST(StdBinDecoder, AttitudeFollowsAUnitMountedBackwards) {
  DecoderConfig config = fixed_config();
  config.axes = {-1, 0, 0, 0, 1, 0, 0, 0, -1};  // the unit's bow points to the vehicle's rear
  Rig rig(config);
  rig.push(TelegramBuilder(3, 5, 1000).nav(0, TelegramBuilder::floats({10.0F, 2.0F, 3.0F})));
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const AttitudeData& attitude = rig.sink.samples[0].attitude;
  EXPECT_NEAR(attitude.heading_rad, 190.0 * kRadPerDeg, 1e-7);
  EXPECT_NEAR(attitude.roll_rad, -2.0 * kRadPerDeg, 1e-7);
  EXPECT_NEAR(attitude.pitch_rad, 3.0 * kRadPerDeg, 1e-7);
}

TEST(StdBinDecoder, HeadingIsNotUsedWhileTheUnitAlignsNorWithoutItsStatus) {
  Rig rig;
  const Bytes angles = TelegramBuilder::floats({10.0F, 2.0F, 3.0F});
  rig.push(TelegramBuilder(3, 1, 1000).nav(0, angles));
  rig.push(TelegramBuilder(3, 2, 1100).nav(0, angles).nav(17, TelegramBuilder::word(kUserAlignment)));
  rig.push(TelegramBuilder(3, 3, 1200).nav(0, angles).nav(17, TelegramBuilder::word(kReadyStatus)));
  rig.push(TelegramBuilder(3, 4, 1300).nav(0, angles).nav(17, TelegramBuilder::word(kUserHrpInvalid)));
  const auto& samples = rig.sink.samples;
  ASSERT_EQ(samples.size(), 4U);
  EXPECT_EQ(samples[0].attitude.flags & kHeadingValid, 0U);
  EXPECT_EQ(samples[1].attitude.flags & kHeadingValid, 0U);
  EXPECT_NE(samples[2].attitude.flags & kHeadingValid, 0U);
  EXPECT_EQ(samples[3].attitude.flags & kHeadingValid, 0U);
  EXPECT_NE(samples[1].attitude.flags & kRollPitchValid, 0U);
}

TEST(StdBinDecoder, TimeGoesOnThroughMidnightWithTheDateBehind) {
  Rig rig;
  // 23:59:59.99, 00:00:00.00 and 00:00:00.01, the date block changing one telegram late.
  rig.push(telegram(1, 863'999'900));
  rig.push(telegram(2, 0));
  TelegramBuilder third = telegram(3, 100);
  rig.push(third.nav(13, TelegramBuilder::date(15, 3, 2026)));
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  ASSERT_EQ(imu.size(), 3U);
  const UtcTime midnight = std::chrono::sys_days{std::chrono::year{2026} / 3 / 15};
  EXPECT_EQ(imu[0].utc, midnight - 10ms);
  EXPECT_EQ(imu[1].utc, midnight);
  EXPECT_EQ(imu[2].utc, midnight + 10ms);
  EXPECT_EQ(imu[1].time - imu[0].time, Duration(10ms));
  EXPECT_EQ(imu[2].time - imu[1].time, Duration(10ms));
  EXPECT_EQ(rig.decoder.counters().clock_resets, 0U);
}

/// 31 December 2016 ended with 23:59:60. A unit may count it, or show a second twice.
TEST(StdBinDecoder, ALeapSecondIsASecondHoweverItIsShown) {
  constexpr std::uint32_t kLast = 863'999'900;  // 23:59:59.99
  struct Way {
    const char* name;
    std::uint32_t first_of_leap_second;
    std::uint8_t day;  // shown during it
  };
  for (const Way& way : {Way{"second 60", 864'000'000, 31}, Way{"second 59 twice", 863'990'000, 31},
                         Way{"second 0 twice", 0, 1}}) {
    SCOPED_TRACE(way.name);
    Rig rig;
    std::uint32_t count = 0;
    const auto push = [&](std::uint32_t ticks, std::uint8_t day) {
      TelegramBuilder one = telegram(++count, ticks);
      rig.push(one.nav(13, TelegramBuilder::date(day, day == 31 ? 12 : 1, day == 31 ? 2016 : 2017)));
    };
    push(kLast - 100, 31);
    push(kLast, 31);
    for (std::uint32_t i = 0; i < 100; ++i) push(way.first_of_leap_second + 100 * i, way.day);
    for (std::uint32_t i = 0; i < 3; ++i) push(100 * i, 1);
    const auto imu = rig.sink.of_kind(SampleKind::kImu);
    ASSERT_EQ(imu.size(), 105U);
    for (std::size_t i = 1; i < imu.size(); ++i)
      EXPECT_EQ(imu[i].time - imu[i - 1].time, Duration(10ms)) << i;
    EXPECT_EQ(rig.decoder.counters().clock_resets, 0U);
    const UtcTime new_year = std::chrono::sys_days{std::chrono::year{2017} / 1 / 1};
    EXPECT_EQ(imu[1].utc, new_year - 10ms);
    EXPECT_EQ(imu[103].utc, new_year + 10ms);
  }
}

TEST(StdBinDecoder, ADateThatChangesOneTelegramEarlyMakesNoExtraDay) {
  Rig rig;
  rig.push(telegram(1, 863'999'800));
  rig.push(telegram(2, 863'999'900).nav(13, TelegramBuilder::date(15, 3, 2026)));
  rig.push(telegram(3, 0).nav(13, TelegramBuilder::date(15, 3, 2026)));
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  ASSERT_EQ(imu.size(), 3U);
  const UtcTime midnight = std::chrono::sys_days{std::chrono::year{2026} / 3 / 15};
  EXPECT_EQ(imu[1].utc, midnight - 10ms);
  EXPECT_EQ(imu[2].utc, midnight);
}

TEST(StdBinDecoder, ThereIsNoUtcWithoutADateOrBeforeTheUnitGotTheTime) {
  Rig rig;
  rig.push(TelegramBuilder(3, 1, 1000).nav(0, TelegramBuilder::floats({1, 2, 3})));
  rig.push(telegram(2, 1100).nav(17, TelegramBuilder::word(0)));
  rig.push(telegram(3, 1200).nav(13, TelegramBuilder::date(0, 0, 0)));
  rig.push(telegram(4, 1300));
  const auto& samples = rig.sink.samples;
  ASSERT_EQ(samples.size(), 7U);
  EXPECT_FALSE(samples[0].has_utc);
  EXPECT_FALSE(samples[1].has_utc);
  EXPECT_FALSE(samples[3].has_utc);
  EXPECT_TRUE(samples[5].has_utc);
}

TEST(StdBinDecoder, AMissingTelegramIsCountedAndMarked) {
  Rig rig;
  rig.push(telegram(10, 1000));
  rig.push(telegram(11, 1100));
  rig.push(telegram(14, 1400));
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  ASSERT_EQ(imu.size(), 3U);
  EXPECT_EQ(rig.decoder.counters().samples_lost, 2U);
  EXPECT_EQ(imu[1].imu.flags & kGapBefore, 0U);
  EXPECT_NE(imu[2].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(imu[2].imu.counter, 14);
}

TEST(StdBinDecoder, TheCounterGoesOnThroughItsWrap) {
  Rig rig;
  rig.push(telegram(0xFFFFFFFF, 1000));
  rig.push(telegram(0, 1100));
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  ASSERT_EQ(imu.size(), 2U);
  EXPECT_EQ(imu[1].imu.counter - imu[0].imu.counter, 1);
  EXPECT_EQ(rig.decoder.counters().samples_lost, 0U);
}

TEST(StdBinDecoder, ATelegramThatComesTwiceOrLateGivesNoSample) {
  Rig rig;
  rig.push(telegram(10, 1000));
  rig.push(telegram(11, 1100));
  rig.push(telegram(11, 1100));
  rig.push(telegram(10, 1000));
  rig.push(telegram(12, 1200));
  EXPECT_EQ(rig.sink.of_kind(SampleKind::kImu).size(), 3U);
  EXPECT_EQ(rig.decoder.counters().bad_contents, 2U);
  EXPECT_EQ(rig.decoder.counters().clock_resets, 0U);
}

TEST(StdBinDecoder, AUnitThatRestartsBeginsANewSegment) {
  for (const std::uint32_t before : {5000U, 4U}) {
    Rig rig;
    rig.push(telegram(before, 5'000'000));
    for (std::uint32_t i = 0; i < 20; ++i) rig.push(telegram(i, 100 * i));
    EXPECT_EQ(rig.decoder.counters().clock_resets, 1U) << before;
    EXPECT_GE(rig.sink.of_kind(SampleKind::kImu).size(), 19U) << before;
    EXPECT_EQ(rig.sink.of_kind(SampleKind::kImu).back().imu.counter, 19) << before;
  }
}

TEST(StdBinDecoder, ZeroRawRatesGiveNoImuSampleAndAreToldApart) {
  Rig rig;
  for (std::uint32_t i = 0; i < 20; ++i) {
    rig.push(telegram(i, 100 * i).extended(2, TelegramBuilder::floats({0, 0, 0})));
  }
  EXPECT_TRUE(rig.sink.of_kind(SampleKind::kImu).empty());
  EXPECT_EQ(rig.sink.of_kind(SampleKind::kAttitude).size(), 20U);
  EXPECT_EQ(rig.decoder.raw_blocks(), RawBlocks::kZero);
  EXPECT_EQ(rig.decoder.raw_blocks_refused(), 20U);
  EXPECT_EQ(rig.decoder.counters().bad_contents, 20U);
  EXPECT_FALSE(describe(rig.decoder.raw_blocks()).empty());
}

TEST(StdBinDecoder, FrozenRawAccelerationStopsTheImuSamplesUntilItMovesAgain) {
  Rig rig;
  for (std::uint32_t i = 0; i < 30; ++i) {
    rig.push(telegram(i, 100 * i).nav(28, TelegramBuilder::floats({0.5F, 0.25F, 9.75F})));
  }
  EXPECT_EQ(rig.decoder.raw_blocks(), RawBlocks::kFrozen);
  EXPECT_EQ(rig.sink.of_kind(SampleKind::kImu).size(), 9U);
  rig.push(telegram(30, 3000));
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  EXPECT_EQ(rig.decoder.raw_blocks(), RawBlocks::kGood);
  ASSERT_EQ(imu.size(), 10U);
  EXPECT_NE(imu.back().imu.flags & kGapBefore, 0U);
}

TEST(StdBinDecoder, MissingRawBlocksAreToldByName) {
  Rig rig;
  rig.push(TelegramBuilder(3, 1, 1).nav(0, TelegramBuilder::floats({1, 2, 3})));
  EXPECT_EQ(rig.decoder.raw_blocks(), RawBlocks::kMissing);
  EXPECT_NE(describe(RawBlocks::kMissing).find("bit 28"), std::string_view::npos);
}

TEST(StdBinDecoder, AValueThatIsNotANumberGivesNoSample) {
  Rig rig;
  rig.push(telegram(1, 100).nav(28, TelegramBuilder::floats({NAN, 0.25F, 9.75F})));
  EXPECT_TRUE(rig.sink.of_kind(SampleKind::kImu).empty());
  EXPECT_EQ(rig.decoder.counters().bad_contents, 1U);
}

TEST(StdBinDecoder, EachOfTheSixValuesMustBeANumberAndTheNextSampleHasAGapBefore) {
  for (std::size_t axis = 0; axis < 6; ++axis) {
    Rig rig;
    std::vector<float> values{0.5F, 0.25F, 9.75F, 1.0F, 2.0F, 3.0F};
    const auto push = [&](std::uint32_t count) {
      rig.push(telegram(count, 100 * count)
                   .nav(28, TelegramBuilder::floats({values[0], values[1], values[2]}))
                   .extended(2, TelegramBuilder::floats({values[3], values[4], values[5]})));
    };
    values[axis] = INFINITY;
    push(1);
    EXPECT_TRUE(rig.sink.of_kind(SampleKind::kImu).empty()) << axis;
    EXPECT_EQ(rig.decoder.counters().bad_contents, 1U) << axis;
    values = {0.6F, 0.35F, 9.85F, 1.1F, 2.1F, 3.1F};
    push(2);
    values[0] += 0.1F;
    values[3] += 0.1F;
    push(3);
    const auto imu = rig.sink.of_kind(SampleKind::kImu);
    ASSERT_EQ(imu.size(), 2U) << axis;
    EXPECT_NE(imu[0].imu.flags & kGapBefore, 0U) << axis;
    EXPECT_EQ(imu[1].imu.flags & kGapBefore, 0U) << axis;
  }
}

TEST(StdBinDecoder, UtcGoesOnThroughTelegramsWithoutADateBlock) {
  Rig rig;
  rig.push(telegram(1, 1000));
  for (std::uint32_t i = 2; i <= 4; ++i) {
    rig.push(TelegramBuilder(3, i, 900 + 100 * i)
                 .nav(28, TelegramBuilder::floats({0.5F + 0.1F * static_cast<float>(i), 0.25F, 9.75F}))
                 .extended(2, TelegramBuilder::floats({1.0F + 0.1F * static_cast<float>(i), 2.0F, 3.0F})));
  }
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  ASSERT_EQ(imu.size(), 4U);
  for (std::size_t i = 1; i < imu.size(); ++i) {
    EXPECT_TRUE(imu[i].has_utc);
    EXPECT_EQ(imu[i].utc - imu[i - 1].utc, Duration(10ms)) << i;
  }
}

TEST(StdBinDecoder, TheRecordedV3UnitIsFoundToSendZeroRatesWhileAligning) {
  IMUSCOPE_NEEDS_SHARED("data/streams/ixblue_stdbin/v3.bin");
  Rig rig;
  rig.decoder.push(test::load_bytes(test::shared_path("data/streams/ixblue_stdbin/v3.bin")), {}, rig.sink);
  EXPECT_EQ(rig.decoder.counters().frames, 17U);
  EXPECT_TRUE(rig.sink.of_kind(SampleKind::kImu).empty());
  EXPECT_EQ(rig.decoder.raw_blocks(), RawBlocks::kZero);
  EXPECT_TRUE(rig.decoder.aligning());
  const auto attitude = rig.sink.of_kind(SampleKind::kAttitude);
  ASSERT_EQ(attitude.size(), 17U);
  for (const Sample& sample : attitude) {
    EXPECT_EQ(sample.attitude.flags & kHeadingValid, 0U);
    EXPECT_TRUE(sample.has_utc);
  }
  // Validity 56698.3535 s of 2019-03-14, as the first telegram's date block and header say.
  const UtcTime day = std::chrono::sys_days{std::chrono::year{2019} / 3 / 14};
  EXPECT_EQ(attitude[0].utc, day + 56698s + 353'500us);
}

TEST(StdBinDecoder, TheFirstByteOfABurstIsDatedBackByItsTimeOnTheWire) {
  DecoderConfig config;
  config.per_byte = 100us;
  Rig rig(config);
  const Bytes first = telegram(1, 1000).build();
  const HostTime arrival = host_time_from_ns(1'000'000'000);
  rig.decoder.push(first, arrival, rig.sink);
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  ASSERT_EQ(imu.size(), 1U);
  EXPECT_EQ(imu[0].arrival, arrival);
  EXPECT_EQ(arrival - imu[0].time, Duration(100us) * static_cast<std::int64_t>(first.size()));
}

TEST(StdBinDecoder, DatesBackByTheRateThatItsLineWasOpenedAt) {
  DecoderConfig config;
  config.per_byte = 100us;
  Rig rig(config);
  rig.decoder.set_per_byte(30us);
  EXPECT_EQ(rig.decoder.per_byte(), Duration(30us));
  const Bytes first = telegram(1, 1000).build();
  const HostTime arrival = host_time_from_ns(1'000'000'000);
  rig.decoder.push(first, arrival, rig.sink);
  const auto imu = rig.sink.of_kind(SampleKind::kImu);
  ASSERT_EQ(imu.size(), 1U);
  EXPECT_EQ(arrival - imu[0].time, Duration(30us) * static_cast<std::int64_t>(first.size()));
}

TEST(StdBinSession, StreamsWithTheFirstGoodTelegram) {
  Session session;
  EXPECT_EQ(session.state(), SessionState::kConnecting);
  session.on_bytes(telegram(1, 100).build(), host_time_from_ns(0));
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_TRUE(session.poll(host_time_from_ns(1)).empty());
  EXPECT_TRUE(session.problem().empty());
}

TEST(StdBinSession, SaysWhatIsWrongWhenNoTelegramComesAndRecovers) {
  Session silent;
  EXPECT_TRUE(silent.poll(host_time_from_ns(0)).empty());
  EXPECT_TRUE(silent.poll(HostTime{4s}).empty());
  EXPECT_EQ(silent.state(), SessionState::kFailed);
  EXPECT_NE(silent.problem().find("cable"), std::string_view::npos);

  Session noisy;
  noisy.on_bytes(Bytes(500, 0x55), HostTime{0s});
  EXPECT_TRUE(noisy.poll(HostTime{4s}).empty());
  EXPECT_EQ(noisy.state(), SessionState::kFailed);
  EXPECT_NE(noisy.problem().find("baud"), std::string_view::npos);
  noisy.on_bytes(telegram(1, 100).build(), HostTime{5s});
  EXPECT_EQ(noisy.state(), SessionState::kStreaming);
  EXPECT_TRUE(noisy.problem().empty());

  Session too_new;
  Bytes v6 = telegram(1, 100).build();
  v6[2] = 6;
  too_new.on_bytes(v6, HostTime{0s});
  EXPECT_TRUE(too_new.poll(HostTime{4s}).empty());
  EXPECT_NE(too_new.problem().find("V6"), std::string_view::npos);
}

TEST(StdBinDecoder, AnAttitudeThatIsNotANumberAndATimeBeyondTheDayAreCounted) {
  Rig rig;
  rig.push(TelegramBuilder(3, 5, 1000).nav(0, TelegramBuilder::floats({NAN, 2.0F, 3.0F})));
  EXPECT_TRUE(rig.sink.samples.empty());
  EXPECT_EQ(rig.decoder.counters().bad_contents, 1U);
  rig.push(telegram(6, 864'010'000));  // a day and a second, in 100 us
  EXPECT_TRUE(rig.sink.samples.empty());
  EXPECT_EQ(rig.decoder.counters().bad_contents, 2U);
}

TEST(StdBinDecoder, AUnitThatFailsHasNoAttitudeAndNegativeSdAreNone) {
  const auto attitude = [](std::uint32_t status, float sd) {
    Rig rig;
    rig.push(TelegramBuilder(3, 5, 1000)
                 .nav(0, TelegramBuilder::floats({350.0F, 2.0F, 3.0F}))
                 .nav(1, TelegramBuilder::floats({0.5F, sd, 0.03F}))
                 .nav(17, TelegramBuilder::word(status)));
    return rig.sink.samples.at(0).attitude.flags;
  };
  EXPECT_EQ(attitude(kReadyStatus, 0.02F), kRollPitchValid | kHeadingValid | kHasAttitudeSd);
  EXPECT_EQ(attitude(kReadyStatus, -0.02F), kRollPitchValid | kHeadingValid);
  EXPECT_EQ(attitude(kUserFailure, 0.02F), static_cast<std::uint32_t>(kHasAttitudeSd));
}

TEST(StdBinDecoder, InTurnedAxesTheLargerTiltSdHoldsForRollAndPitch) {
  DecoderConfig config = fixed_config();
  config.axes = {0, 1, 0, 1, 0, 0, 0, 0, -1};
  Rig rig(config);
  rig.push(TelegramBuilder(3, 5, 1000)
               .nav(0, TelegramBuilder::floats({350.0F, 2.0F, 3.0F}))
               .nav(1, TelegramBuilder::floats({0.5F, 0.02F, 0.03F})));
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const auto& sd = rig.sink.samples[0].attitude.sd_rpy_rad;
  EXPECT_NEAR(sd[0], 0.03 * kRadPerDeg, 1e-9);
  EXPECT_NEAR(sd[1], 0.03 * kRadPerDeg, 1e-9);
  EXPECT_NEAR(sd[2], 0.5 * kRadPerDeg, 1e-8);
}

}  // namespace
}  // namespace imuscope::ixblue_stdbin
