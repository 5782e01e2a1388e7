// Groups of CAN frames of an MTi to samples.
#include "drivers/xsens_can/decoder.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "drivers/dbc/parser.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::xsens_can {
namespace {

using namespace std::chrono_literals;
using Data = std::vector<std::uint8_t>;

Data be(std::initializer_list<std::pair<std::int64_t, int>> numbers) {
  Data data;
  for (const auto& [number, bytes] : numbers) {
    for (int i = bytes - 1; i >= 0; --i)
      data.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(number) >> (8 * i) & 0xFFU));
  }
  return data;
}
Data triad(int x, int y, int z) { return be({{x, 2}, {y, 2}, {z, 2}}); }

constexpr int kDeltaVExponent = 15;
constexpr double kRest_mps2 = 9.81;

/// An MTi at 100 Hz, turning about z at 0.5 rad/s, standing upright.
struct Unit {
  explicit Unit(DecoderConfig config = {}) : decoder(config), ids(config.ids) { sink.samples.reserve(5000); }

  void frame(Item item, const Data& data) { frame(ids[static_cast<std::size_t>(item)], data); }
  void frame(CanId id, const Data& data) {
    CanFrame can;
    can.id = id.id;
    can.is_extended = id.is_extended;
    can.length = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), can.data.begin());
    can.stamp = HostTime{now};
    now += 200us;
    std::array<std::uint8_t, kCanRecordMaxBytes> record{};
    const std::size_t size = write_can_record(can, record);
    decoder.push(std::span(record).first(size), read_at.value_or(can.stamp + 1ms), sink);
  }

  void opening() {
    frame(Item::kSampleTime, be({{sample_time, 4}}));
    frame(Item::kGroupCounter, be({{counter, 2}}));
  }
  void increments() {
    const double half = 0.5 * 0.5 * 0.01;
    frame(Item::kDeltaV,
          be({{0, 2}, {0, 2}, {std::lround(kRest_mps2 * 0.01 * 32768.0), 2}, {kDeltaVExponent, 1}}));
    frame(Item::kDeltaQ, be({{std::lround(32767.0 * std::cos(half)), 2},
                             {0, 2},
                             {0, 2},
                             {std::lround(32767.0 * std::sin(half)), 2}}));
  }
  void rates() {
    frame(Item::kRateOfTurn, triad(0, 0, 256));
    frame(Item::kAcceleration, triad(0, 0, static_cast<int>(std::lround(kRest_mps2 * 256.0))));
  }
  /// Time goes on by one period, whatever was sent.
  void next_period() {
    sample_time = (sample_time + 100 * ticks_per_100us) & 0xFFFF'FFFF;
    counter = (counter + 1) & 0xFFFF;
    period += 1;
    now = HostTime{1s + period * 10ms}.time_since_epoch();
  }
  template <typename Send>
  void groups(int n, Send send) {
    for (int i = 0; i < n; ++i, next_period()) {
      opening();
      send();
    }
  }
  [[nodiscard]] const std::vector<Sample>& samples() const { return sink.samples; }

  Decoder decoder;
  ItemIds ids;
  test::CollectingSink sink;
  std::int64_t sample_time = 1000;
  std::int64_t counter = 10;
  std::int64_t ticks_per_100us = 1;
  std::int64_t period = 0;
  Duration now = 1s;
  std::optional<HostTime> read_at{};  ///< where the host stands still
};

TEST(XsensCanMessages, TheFixedPointNumbersOfTheVectorsDecode) {
  const auto expected = test::load_json(test::source_path("tests/vectors/can_xsens.json"));
  int checked = 0;
  for (const auto& vector : expected["vectors"]) {
    const auto line = vector["line"].get<std::string>();
    SCOPED_TRACE(line);
    Data data;
    for (std::size_t at = line.find('#') + 1; at + 1 < line.size(); at += 2)
      data.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(at, 2), nullptr, 16)));
    const auto& signals = vector["signals"];
    const auto id = vector["id"].get<std::uint32_t>();
    ++checked;
    if (id == 0x005) {
      EXPECT_EQ(read_u32(data), signals["ticks"].get<std::uint32_t>());
    } else if (id == 0x006) {
      EXPECT_EQ(read_u16(data), signals["counter"].get<std::uint16_t>());
    } else if (id == 0x011) {
      EXPECT_EQ(read_u32(data), signals["status"].get<std::uint32_t>());
    } else if (id == 0x031) {
      const double scale = std::ldexp(1.0, -signals["exponent"].get<int>());
      EXPECT_EQ(read_delta_v(data),
                (Triad{scale * signals["dvx_raw"].get<double>(), scale * signals["dvy_raw"].get<double>(),
                       scale * signals["dvz_raw"].get<double>()}));
    } else if (id == 0x032) {
      EXPECT_EQ(read_scaled(data, kRate_radps), (Triad{signals["gx"], signals["gy"], signals["gz"]}));
    } else if (id == 0x034) {
      EXPECT_EQ(read_scaled(data, kAcceleration_mps2), (Triad{signals["ax"], signals["ay"], signals["az"]}));
    } else {
      --checked;
    }
  }
  EXPECT_EQ(checked, 8);
}

TEST(XsensCan, AHostThatStandsStillChangesNoTimeAndLosesNoSample) {
  for (const int stall_s : {5, 11, 15, 60}) {
    Unit unit;
    constexpr int kBefore = 3000;
    unit.groups(kBefore, [&] { unit.rates(); });
    unit.read_at = HostTime{unit.now} + std::chrono::seconds(stall_s);
    const int held = stall_s * 100;
    unit.groups(held, [&] { unit.rates(); });
    unit.read_at.reset();
    unit.groups(1000, [&] { unit.rates(); });
    const auto& samples = unit.samples();
    ASSERT_GE(samples.size(), static_cast<std::size_t>(kBefore + held + 998)) << stall_s;
    for (std::size_t i = kBefore; i < samples.size(); ++i)
      ASSERT_NEAR(to_seconds(samples[i].time - samples[i - 1].time), 0.01, 1e-5)
          << stall_s << " s, sample " << i;
    EXPECT_EQ(unit.decoder.counters().clock_resets, 0U) << stall_s;
    EXPECT_EQ(unit.decoder.counters().samples_lost, 0U) << stall_s;
  }
}

TEST(XsensCan, AGroupIsClosedByTheNextOneThatOpens) {
  Unit unit;
  unit.groups(2, [&] { unit.increments(); });
  EXPECT_TRUE(unit.samples().empty())
      << "the first group only teaches the length of a tick, the second is open";
  unit.frame(Item::kSampleTime, be({{unit.sample_time, 4}}));
  ASSERT_EQ(unit.samples().size(), 1U);
  const Sample& sample = unit.samples()[0];
  EXPECT_EQ(sample.imu.flags, kGyroValid | kAccelValid | kIsIncrement);
  EXPECT_NEAR(sample.imu.omega_radps[2], 0.5, 0.5 / 32767.0 / 0.01);
  EXPECT_NEAR(sample.imu.f_mps2[2], kRest_mps2, 1.0 / 32768.0 / 0.01);
  EXPECT_EQ(sample.imu.counter, 11);
  EXPECT_EQ(sample.time, HostTime{1s + 10ms}) << "the group's own first frame";
  EXPECT_EQ(sample.arrival, HostTime{1s + 21ms}) << "the read that closed it";
}

TEST(XsensCan, IncrementsArePreferredToTheCoarseRates) {
  Unit unit;
  unit.groups(3, [&] { unit.rates(); });
  EXPECT_EQ(unit.decoder.source(), Source::kRates);
  EXPECT_EQ(unit.samples().at(0).imu.flags, kGyroValid | kAccelValid);
  EXPECT_EQ(unit.samples().at(0).imu.omega_radps[2], 0.5);
  unit.groups(2, [&] {
    unit.rates();
    unit.increments();
  });
  unit.opening();
  EXPECT_EQ(unit.decoder.source(), Source::kIncrements);
  EXPECT_NE(unit.samples().back().imu.flags & kIsIncrement, 0U);
  // One frame of increments lost: no mixture of means and instants, a gap instead.
  const std::size_t before = unit.samples().size();
  unit.rates();
  unit.next_period();
  unit.groups(2, [&] {
    unit.rates();
    unit.increments();
  });
  ASSERT_EQ(unit.samples().size(), before + 1);
  EXPECT_NE(unit.samples().back().imu.flags & kGapBefore, 0U);
  EXPECT_NE(unit.samples().back().imu.flags & kIsIncrement, 0U);
  // The increments stay away: after a second the rates are taken.
  unit.groups(150, [&] { unit.rates(); });
  EXPECT_EQ(unit.decoder.source(), Source::kRates);
}

TEST(XsensCan, TimeAndCounterRollOver) {
  Unit unit;
  unit.sample_time = 0xFFFF'FFFF - 450;
  unit.counter = 0xFFFF - 7;
  unit.groups(30, [&] { unit.increments(); });
  ASSERT_EQ(unit.samples().size(), 28U);
  for (std::size_t i = 1; i < unit.samples().size(); ++i) {
    EXPECT_EQ(unit.samples()[i].imu.counter, unit.samples()[i - 1].imu.counter + 1);
    EXPECT_EQ(unit.samples()[i].time - unit.samples()[i - 1].time, 10ms);
    EXPECT_EQ(unit.samples()[i].imu.flags & kGapBefore, 0U);
  }
  EXPECT_EQ(unit.decoder.counters().samples_lost, 0U);
  EXPECT_EQ(unit.decoder.counters().clock_resets, 0U);
}

TEST(XsensCan, BothLengthsOfATickAreToldApartAtAKnownRate) {
  Unit coarse;
  coarse.groups(5, [&] { coarse.increments(); });
  EXPECT_EQ(coarse.decoder.tick_ns(), 100'000);
  Unit fine;
  fine.ticks_per_100us = 100;
  fine.groups(5, [&] { fine.increments(); });
  EXPECT_EQ(fine.decoder.tick_ns(), 1'000);
  EXPECT_EQ(fine.samples().at(1).time - fine.samples().at(0).time, 10ms);
  EXPECT_NEAR(fine.samples().at(1).imu.f_mps2[2], kRest_mps2, 1.0 / 32768.0 / 0.01);
}

TEST(XsensCan, ATimeRoundedToTheTickDoesNotReachTheRates) {
  Unit unit;
  for (int i = 0; i < 20; ++i) {
    unit.sample_time += i % 2 == 0 ? 1 : -1;
    unit.groups(1, [&] { unit.increments(); });
  }
  for (const Sample& sample : unit.samples()) EXPECT_NEAR(sample.imu.f_mps2[2], kRest_mps2, 0.01);
  // A device that sends at another rate than configured is taken at its word.
  Unit slow;
  for (int i = 0; i < 20; ++i) {
    slow.sample_time += 100;  // 50 Hz
    slow.period += 1;
    slow.groups(1, [&] { slow.increments(); });
  }
  EXPECT_NEAR(slow.samples().back().imu.f_mps2[2], 0.5 * kRest_mps2, 0.01);
}

TEST(XsensCan, LostGroupsAreCountedAndTheNextSampleSaysSo) {
  Unit unit;
  unit.groups(5, [&] { unit.increments(); });
  for (int i = 0; i < 3; ++i) unit.next_period();
  unit.groups(5, [&] { unit.increments(); });
  EXPECT_EQ(unit.decoder.counters().samples_lost, 3U);
  std::size_t gaps = 0;
  for (const Sample& sample : unit.samples()) {
    if ((sample.imu.flags & kGapBefore) == 0) continue;
    ++gaps;
    EXPECT_EQ(sample.imu.counter, 18);
    EXPECT_NEAR(sample.imu.f_mps2[2], kRest_mps2, 1.0 / 32768.0 / 0.01)
        << "an increment spans one period, not the gap";
  }
  EXPECT_EQ(gaps, 1U);
}

/// Gravity in one message and a rate near zero in the other.
void rest(Unit& unit, Item acceleration, Item rate, int copies = 1) {
  for (int i = 0; i < copies; ++i) {
    unit.frame(acceleration, triad(0, 0, 2511));
    unit.frame(rate, triad(2, -1, 1));
  }
}

TEST(XsensCan, AFrameThatIsLostOrComesTwiceCostsNoMoreThanItsOwnGroup) {
  enum class What { kTime, kCounter, kIncrement };
  for (const What what : {What::kTime, What::kCounter, What::kIncrement}) {
    for (const bool twice : {false, true}) {
      SCOPED_TRACE(testing::Message() << "frame " << static_cast<int>(what) << (twice ? " twice" : " lost"));
      Unit unit;
      unit.groups(5, [&] { unit.increments(); });
      const int times = twice ? 2 : 0;
      for (int i = 0; i < (what == What::kTime ? times : 1); ++i)
        unit.frame(Item::kSampleTime, be({{unit.sample_time, 4}}));
      for (int i = 0; i < (what == What::kCounter ? times : 1); ++i)
        unit.frame(Item::kGroupCounter, be({{unit.counter, 2}}));
      if (what != What::kIncrement || twice) unit.increments();
      unit.next_period();
      unit.groups(5, [&] { unit.increments(); });

      const std::size_t lost = what == What::kIncrement && !twice ? 1 : 0;
      EXPECT_EQ(unit.samples().size(), 9U - lost);  // the first teaches, the last is open
      EXPECT_EQ(unit.decoder.counters().samples_lost, lost);
      EXPECT_EQ(unit.decoder.counters().clock_resets, 0U);
      for (std::size_t i = 1; i < unit.samples().size(); ++i) {
        const Sample& before = unit.samples()[i - 1];
        const Sample& sample = unit.samples()[i];
        EXPECT_EQ(sample.time - before.time, (sample.imu.counter - before.imu.counter) * 10ms);
        EXPECT_NEAR(sample.imu.f_mps2[2], kRest_mps2, 1.0 / 32768.0 / 0.01);
      }
    }
  }
}

TEST(XsensCan, ARestTellsWhichHighRateMessageIsTheAcceleration) {
  for (const bool first : {true, false}) {
    Unit unit;
    const Item acceleration = first ? Item::kHighRateFirst : Item::kHighRateSecond;
    const Item rate = first ? Item::kHighRateSecond : Item::kHighRateFirst;
    // On the move: rotation and force leave it open.
    unit.groups(100, [&] {
      unit.frame(acceleration, triad(300, 0, 2511));
      unit.frame(rate, triad(0, 0, 256));
    });
    EXPECT_TRUE(unit.samples().empty());
    EXPECT_NE(unit.decoder.remark().find("061 and 062"), std::string::npos) << unit.decoder.remark();
    unit.groups(60, [&] { rest(unit, acceleration, rate); });
    EXPECT_EQ(unit.decoder.high_rate_order(),
              first ? HighRateOrder::kAccelerationFirst : HighRateOrder::kRateFirst);
    ASSERT_FALSE(unit.samples().empty());
    EXPECT_NEAR(unit.samples().back().imu.f_mps2[2], 2511.0 / 256.0, 1e-12);
    EXPECT_NEAR(unit.samples().back().imu.omega_radps[0], 2.0 / 512.0, 1e-12);
    EXPECT_EQ(unit.decoder.remark(), "");
  }
}

TEST(XsensCan, SeveralHighRateFramesOfAGroupAreAveraged) {
  Unit unit;
  unit.groups(60, [&] { rest(unit, Item::kHighRateFirst, Item::kHighRateSecond, 4); });
  unit.groups(2, [&] {
    for (const int x : {10, 20, 30, 40}) {
      unit.frame(Item::kHighRateFirst, triad(x, 0, 2511));
      unit.frame(Item::kHighRateSecond, triad(0, x, 0));
    }
  });
  unit.opening();
  EXPECT_NEAR(unit.samples().back().imu.f_mps2[0], 25.0 / 256.0, 1e-12);
  EXPECT_NEAR(unit.samples().back().imu.omega_radps[1], 25.0 / 512.0, 1e-12);
  EXPECT_NE(unit.samples().back().imu.flags & kIsIncrement, 0U);
}

TEST(XsensCan, AGroupWithOneOfTheTwoHighRateMessagesTellsNothingAndIsAGap) {
  for (const Item alone : {Item::kHighRateFirst, Item::kHighRateSecond}) {
    Unit unit;
    unit.groups(60, [&] { rest(unit, Item::kHighRateFirst, Item::kHighRateSecond); });
    const auto before = unit.samples().size();
    const auto lost_before = unit.decoder.counters().samples_lost;
    unit.groups(1, [&] { unit.frame(alone, triad(2, 0, 2511)); });
    unit.groups(2, [&] { rest(unit, Item::kHighRateFirst, Item::kHighRateSecond); });
    unit.opening();
    // The group that was open before, and the two after the one that lacks a message.
    ASSERT_EQ(unit.samples().size(), before + 3);
    EXPECT_EQ(unit.decoder.counters().samples_lost, lost_before + 1);
    EXPECT_NE(unit.samples()[before + 1].imu.flags & kGapBefore, 0U);
    EXPECT_EQ(unit.decoder.high_rate_order(), HighRateOrder::kAccelerationFirst);
  }
}

TEST(XsensCan, OtherIdentifiersTheAxesAndTheClippedAxesAreHeeded) {
  DecoderConfig config;
  config.device = 4;
  config.axes = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  for (std::size_t i = 0; i < kItemCount; ++i)
    config.ids[i] = {0x18FF0000U + static_cast<std::uint32_t>(i), true};
  Unit unit(config);
  EXPECT_EQ(unit.decoder.ids().size(), kItemCount);
  unit.frame(CanId{0x005, false}, be({{1, 4}}));  // another unit on the same bus
  unit.groups(3, [&] {
    unit.frame(Item::kStatusWord, be({{1U << 8U | 1U << 13U, 4}}));
    unit.increments();
  });
  ASSERT_EQ(unit.samples().size(), 1U);
  const Sample& sample = unit.samples()[0];
  EXPECT_EQ(sample.device, 4);
  EXPECT_LT(sample.imu.f_mps2[2], -9.7);
  EXPECT_LT(sample.imu.omega_radps[2], -0.4);
  EXPECT_EQ(sample.imu.flags, kGyroValid | kAccelValid | kIsIncrement | kAccelClipX | kGyroClipZ);
}

TEST(XsensCan, WithoutACounterTheTimeCountsAndWithoutATimeTheCounterTimes) {
  Unit timed;
  for (int i = 0; i < 10; ++i, timed.next_period()) {
    if (i == 6) timed.next_period();
    timed.frame(Item::kSampleTime, be({{timed.sample_time, 4}}));
    timed.increments();
  }
  EXPECT_EQ(timed.decoder.counters().samples_lost, 1U);
  EXPECT_EQ(timed.samples().back().imu.counter - timed.samples().front().imu.counter, 8);
  Unit counted;
  for (int i = 0; i < 10; ++i, counted.next_period()) {
    counted.frame(Item::kGroupCounter, be({{counted.counter, 2}}));
    counted.increments();
  }
  EXPECT_EQ(counted.samples().size(), 9U);
  EXPECT_EQ(counted.samples()[1].time - counted.samples()[0].time, 10ms);
}

TEST(XsensCan, ProblemsAreNamedWithTheirRemedy) {
  Unit overflow;
  overflow.groups(3, [&] {
    overflow.increments();
    overflow.frame(Item::kError, {1});
  });
  EXPECT_NE(overflow.decoder.remark().find("output buffer overflowed"), std::string::npos);
  EXPECT_EQ(overflow.samples().size(), 1U);

  Unit short_frames;
  short_frames.groups(3, [&] { short_frames.frame(Item::kDeltaV, {0, 1, 2}); });
  EXPECT_EQ(short_frames.decoder.counters().bad_lengths, 3U);
  EXPECT_NE(short_frames.decoder.remark().find("too short"), std::string::npos);

  Unit half;
  half.groups(5, [&] { half.frame(Item::kRateOfTurn, triad(0, 0, 0)); });
  EXPECT_TRUE(half.samples().empty());
  EXPECT_NE(half.decoder.remark().find("switch on delta_v and delta_q"), std::string::npos);
}

TEST(XsensCan, AnErrorBetweenTheOpeningFramesSplitsNoGroup) {
  Unit unit;
  for (int i = 0; i < 5; ++i, unit.next_period()) {
    unit.frame(Item::kSampleTime, be({{unit.sample_time, 4}}));
    unit.frame(Item::kError, {1});
    unit.frame(Item::kGroupCounter, be({{unit.counter, 2}}));
    unit.increments();
  }
  EXPECT_EQ(unit.samples().size(), 3U);
  EXPECT_EQ(unit.decoder.counters().bad_contents, 0U);
}

TEST(XsensCan, DecodingAllocatesNothing) {
  std::vector<Data> records;
  for (int i = 0; i < 500; ++i) {
    for (const auto& [id, data] : std::initializer_list<std::pair<std::uint32_t, Data>>{
             {0x005, be({{100 * i, 4}})},
             {0x006, be({{i, 2}})},
             {0x031, be({{0, 2}, {0, 2}, {3214, 2}, {15, 1}})},
             {0x033, be({{32767, 2}, {0, 2}, {0, 2}, {0, 2}})}}) {
      CanFrame can;
      can.id = id;
      can.length = static_cast<std::uint8_t>(data.size());
      std::copy(data.begin(), data.end(), can.data.begin());
      can.stamp = HostTime{1s + i * 10ms};
      Data record(kCanRecordMaxBytes);
      record.resize(write_can_record(can, record));
      records.push_back(std::move(record));
    }
  }
  Decoder decoder{DecoderConfig{}};
  test::CollectingSink sink;
  sink.samples.reserve(1000);
  const std::uint64_t before = test::allocation_count();
  for (const Data& record : records) decoder.push(record, HostTime{10s}, sink);
  EXPECT_EQ(test::allocation_count(), before);
  EXPECT_EQ(sink.samples.size(), 498U);
}

TEST(XsensCanDecoder, ADeviceThatStartsAnewBeginsOneNewSegment) {
  Unit unit;
  unit.sample_time = 5'000'000;
  unit.counter = 30'000;
  unit.groups(500, [&] { unit.increments(); });
  const std::size_t before = unit.samples().size();
  unit.sample_time = 100;
  unit.counter = 0;
  unit.groups(500, [&] { unit.increments(); });
  EXPECT_EQ(unit.decoder.counters().clock_resets, 1U);
  EXPECT_EQ(unit.decoder.counters().samples_lost, 0U);
  // Two doubtful groups by the counter and one by the time.
  EXPECT_GE(unit.samples().size(), before + 496);
  const auto gaps = std::count_if(unit.samples().begin() + 1, unit.samples().end(),
                                  [](const Sample& sample) { return (sample.imu.flags & kGapBefore) != 0; });
  EXPECT_EQ(gaps, 1);
  for (std::size_t i = 1; i < unit.samples().size(); ++i)
    ASSERT_GT(unit.samples()[i].time, unit.samples()[i - 1].time) << i;
}

TEST(XsensCanDecoder, GroupsWithoutTimeAndCountGiveNoSampleAndTheRemedyIsSaid) {
  Unit unit;
  for (int i = 0; i < 10; ++i, unit.next_period()) unit.increments();
  EXPECT_TRUE(unit.samples().empty());
  EXPECT_NE(unit.decoder.remark().find("SampleTime"), std::string_view::npos);
}

// Everything that comes out of rich streams, held as it once was.

std::string all_of(Unit& unit) {
  std::string text;
  for (const Sample& sample : unit.samples()) text += test::sample_text(sample) + '\n';
  text += test::counts_text(unit.decoder.counters()) + " source " +
          std::to_string(static_cast<int>(unit.decoder.source())) + " tick " +
          std::to_string(unit.decoder.tick_ns()) + " order " +
          std::to_string(static_cast<int>(unit.decoder.high_rate_order())) + " drift " +
          test::real_text(unit.decoder.clock_drift_ppm()) + '\n';
  return text + std::string(unit.decoder.remark()) + "\n--\n";
}

DecoderConfig whole_config() {
  DecoderConfig config;
  config.device = 3;
  config.axes = {0, 1, 0, 0, 0, -1, -1, 0, 0};
  return config;
}

/// Numbers that change from group to group and are all different.
void moving_increments(Unit& unit) {
  const auto k = unit.period;
  unit.frame(Item::kDeltaV, be({{100 + k, 2}, {-200 - k, 2}, {3200 + k, 2}, {15, 1}}));
  unit.frame(Item::kDeltaQ, be({{32700, 2}, {300 + k, 2}, {-400, 2}, {500 - k, 2}}));
}
void moving_rates(Unit& unit) {
  const auto k = static_cast<int>(unit.period);
  unit.frame(Item::kRateOfTurn, triad(10 + k, -20, 256 - k));
  unit.frame(Item::kAcceleration, triad(30 + k, -40 - k, 2511));
}

TEST(XsensCanWhole, GroupsOfEveryKind) {
  std::string text;
  for (const std::int64_t ticks : {1, 100}) {
    Unit unit(whole_config());
    unit.ticks_per_100us = ticks;
    unit.groups(4, [&] { moving_increments(unit); });
    unit.groups(2, [&] { moving_rates(unit); });
    unit.groups(2, [&] {
      unit.frame(Item::kStatusWord, be({{0x2900, 4}}));
      moving_increments(unit);
    });
    unit.counter += 3;  // lost groups
    unit.sample_time += 300 * ticks;
    unit.groups(2, [&] { moving_increments(unit); });
    unit.sample_time += 7 * ticks;  // another step than the period
    unit.groups(2, [&] { moving_increments(unit); });
    unit.groups(1, [&] { unit.frame(Item::kError, be({{1, 1}})); });
    unit.groups(2, [&] { moving_increments(unit); });
    unit.groups(1, [&] { unit.frame(Item::kDeltaV, be({{1, 2}, {2, 2}, {3, 2}, {15, 1}})); });
    unit.groups(1, [&] { unit.frame(Item::kDeltaQ, be({{1, 2}})); });
    unit.groups(2, [&] { moving_increments(unit); });
    // Without one of the two that open a group.
    for (int i = 0; i < 2; ++i, unit.next_period()) {
      unit.frame(Item::kSampleTime, be({{unit.sample_time, 4}}));
      moving_increments(unit);
    }
    for (int i = 0; i < 2; ++i, unit.next_period()) {
      unit.frame(Item::kGroupCounter, be({{unit.counter, 2}}));
      moving_increments(unit);
    }
    unit.groups(2, [&] { moving_increments(unit); });
    // Repeated openings, and one of another group.
    unit.opening();
    unit.opening();
    moving_increments(unit);
    unit.opening();
    unit.next_period();
    unit.frame(Item::kSampleTime, be({{unit.sample_time, 4}}));
    unit.frame(Item::kSampleTime, be({{unit.sample_time + 100 * ticks, 4}}));
    moving_increments(unit);
    unit.next_period(), unit.next_period();
    unit.groups(2, [&] { moving_increments(unit); });
    // Starts anew.
    unit.counter = 0;
    unit.sample_time = 50;
    unit.groups(4, [&] { moving_increments(unit); });
    unit.sample_time = 4'294'967'296 - 150 * ticks;
    unit.groups(5, [&] { moving_increments(unit); });
    text += all_of(unit);
  }
  test::expect_recorded("drivers/xsens_can/groups.txt", text, test::kSampleShare);
}

TEST(XsensCanWhole, TimeAloneCountAloneAndABetterSourceThatGoes) {
  std::string text;
  {
    Unit unit(whole_config());
    for (int i = 0; i < 6; ++i, unit.next_period()) {
      unit.frame(Item::kSampleTime, be({{unit.sample_time, 4}}));
      moving_rates(unit);
      if (i == 3) unit.next_period(), unit.next_period();
    }
    text += all_of(unit);
  }
  {
    Unit unit(whole_config());
    for (int i = 0; i < 6; ++i, unit.next_period()) {
      unit.frame(Item::kGroupCounter, be({{unit.counter, 2}}));
      moving_rates(unit);
      if (i == 3) unit.next_period(), unit.next_period();
    }
    text += all_of(unit);
  }
  for (const int without : {99, 100, 101}) {
    Unit unit(whole_config());
    unit.groups(3, [&] { moving_increments(unit); });
    unit.groups(without, [&] { moving_rates(unit); });
    unit.groups(3, [&] { moving_rates(unit); });
    text += all_of(unit);
  }
  for (const double rate_hz : {50.0, 400.0}) {
    DecoderConfig config = whole_config();
    config.rate_hz = rate_hz;
    config.clock = ClockMapConfig::fixed(HostTime{5s}, 1.0);
    Unit unit(config);
    unit.groups(4, [&] { moving_increments(unit); });
    text += all_of(unit);
  }
  // The tick is told by the side of a step.
  for (const std::int64_t ticks : {1, 9, 10, 11, 100}) {
    Unit unit(whole_config());
    unit.ticks_per_100us = ticks;
    unit.groups(3, [&] { moving_rates(unit); });
    text += std::to_string(ticks) + ' ' + all_of(unit);
  }
  test::expect_recorded("drivers/xsens_can/sources.txt", text, test::kSampleShare);
}

TEST(XsensCanWhole, HighRateFramesAndWhichOfThemIsTheForce) {
  std::string text;
  struct Case {
    int force, rate;
    bool force_first;
    int frames;
  };
  for (const Case& one :
       {Case{2511, 10, true, 1}, Case{2511, 10, false, 2}, Case{2637, 10, true, 1}, Case{2640, 10, true, 1},
        Case{2384, 10, true, 1}, Case{2382, 10, true, 1}, Case{2511, 17, true, 1}, Case{2511, 18, true, 1}}) {
    Unit unit(whole_config());
    unit.groups(54, [&] {
      for (int i = 0; i < one.frames; ++i) {
        const auto k = static_cast<int>(unit.period % 3);
        unit.frame(one.force_first ? Item::kHighRateFirst : Item::kHighRateSecond,
                   triad(3 * i, k, one.force));
        unit.frame(one.force_first ? Item::kHighRateSecond : Item::kHighRateFirst,
                   triad(one.rate, 1 - k, 2 * i));
      }
    });
    text += std::to_string(one.force) + ' ' + std::to_string(one.rate) + ' ' + all_of(unit);
  }
  test::expect_recorded("drivers/xsens_can/high_rate.txt", text, test::kSampleShare);
}

TEST(XsensCanWhole, FramesOfEveryLengthAndWhatIsRemarked) {
  std::string text;
  for (std::size_t item = 0; item < kItemCount; ++item) {
    for (std::size_t size = 0; size <= 8; ++size) {
      Unit unit(whole_config());
      unit.opening();
      unit.frame(static_cast<Item>(item), Data(size, 1));
      text += std::to_string(item) + ' ' + std::to_string(size) + ' ' +
              test::counts_text(unit.decoder.counters()) + ' ' + std::string(unit.decoder.remark()) + '\n';
    }
  }
  for (const int frames : {7, 8, 9, 10}) {
    Unit unit(whole_config());
    for (int i = 0; i < frames; ++i) unit.frame(Item::kStatusWord, be({{1, 4}}));
    text += std::to_string(frames) + ' ' + std::string(unit.decoder.remark()) + '\n';
    unit.opening();
    text += std::string(unit.decoder.remark()) + '\n';
  }
  Unit forces(whole_config());
  forces.groups(3, [&] { forces.frame(Item::kAcceleration, triad(1, 2, 3)); });
  text += all_of(forces);
  Unit other(whole_config());
  other.frame(CanId{0x123, false}, Data(8, 1));
  other.frame(CanId{0x005, true}, Data(8, 1));
  other.frame(Item::kError, be({{0, 1}}));
  text += all_of(other);
  for (const Data& data :
       {be({{0x8001, 2}, {0x7FFF, 2}, {-3, 2}, {200, 1}}), be({{1, 2}, {2, 2}, {3, 2}, {0, 1}})}) {
    text += test::real_text(read_delta_v(data).value_or(Triad{})) + ' ' +
            test::real_text(read_delta_q(data).value_or(std::array<double, 4>{})) + '\n';
  }
  test::expect_recorded("drivers/xsens_can/lengths.txt", text, test::kSampleShare);
}

}  // namespace
}  // namespace imuscope::xsens_can
