// Epochs to samples: time, date, solution types, standard deviations, losses; and the receiver's session.
#include "drivers/greis/decoder.h"

#include <gtest/gtest.h>
#include <cmath>
#include <numbers>

#include "tests/drivers/greis/message_builder.h"
#include "tests/support/shared_data.h"

namespace imuscope::greis {
namespace {

using namespace test;
using namespace std::chrono_literals;

DecoderConfig fixed_config() {
  DecoderConfig config;
  config.device = 4;
  config.clock = ClockMapConfig::fixed(host_time_from_ns(0), 1.0);
  return config;
}

struct Rig {
  explicit Rig(const DecoderConfig& config = fixed_config()) : decoder(config) {}
  void push(std::initializer_list<Bytes> messages) { decoder.push(lines(messages), {}, sink); }
  Decoder decoder;
  CollectingSink sink;
};

const UtcTime kDay = std::chrono::sys_days{std::chrono::year{2026} / 3 / 14};

TEST(GreisDecoder, AnRtkEpochBecomesAFixedSolutionWithTimeAndSd) {
  Rig rig;
  rig.push({rt(45'000'100), rd(2026, 3, 14, 0), st(45'000'100, 4), pg(0.85, 0.04, 106.5, 0.5F, 4),
            vg(1.5F, -0.5F, 0.25F, 0.5F, 4), sg(0.010F, 0.015F, 0.020F, 0.030F, 4), et(45'000'100)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const Sample& sample = rig.sink.samples[0];
  EXPECT_EQ(sample.kind, SampleKind::kGnss);
  EXPECT_EQ(sample.device, 4);
  EXPECT_EQ(sample.gnss.solution, GnssSolution::kFixed);
  EXPECT_EQ(sample.gnss.latitude_rad, 0.85);
  EXPECT_EQ(sample.gnss.longitude_rad, 0.04);
  EXPECT_EQ(sample.gnss.height_m, 106.5);
  EXPECT_EQ(sample.gnss.v_n_mps, (Vector3{1.5, -0.5, -0.25}));
  EXPECT_NEAR(sample.gnss.sd_position_m[0], 0.010 / std::numbers::sqrt2, 1e-8);
  EXPECT_NEAR(sample.gnss.sd_position_m[2], 0.015, 1e-8);
  EXPECT_NEAR(sample.gnss.sd_velocity_mps[1], 0.020 / std::numbers::sqrt2, 1e-8);
  EXPECT_EQ(sample.gnss.flags, kPositionValid | kVelocityValid | kHasPositionSd | kHasVelocitySd);
  ASSERT_TRUE(sample.has_utc);
  EXPECT_EQ(sample.utc, kDay + 45'000'100ms - 18s);  // GPS time is 18 s ahead of UTC
  EXPECT_EQ(to_ns(sample.time), 45'000'100'000'000);
}

TEST(GreisDecoder, ADelayedSolutionIsStampedWithItsOwnEpoch) {
  Rig rig;
  rig.push({rt(1000), rd(2026, 3, 14, 1), st(600, 4), pg(0.85, 0.04, 106.5, 0.5F, 4), et(1000)});
  // Across midnight: the solution is of the day before.
  rig.push({rt(1200), st(86'399'900, 4), pg(0.85, 0.04, 106.5, 0.5F, 4), et(1200)});
  ASSERT_EQ(rig.sink.samples.size(), 2U);
  EXPECT_EQ(rig.sink.samples[0].utc, kDay + 600ms);
  EXPECT_EQ(to_ns(rig.sink.samples[0].time), 600'000'000);
  EXPECT_EQ(rig.sink.samples[1].utc, kDay - 100ms);
}

TEST(GreisDecoder, TheClockOffsetLeadsToTheReferenceTime) {
  Rig rig;
  rig.push({rt(1000), rd(2026, 3, 14, 1), pg(0.85, 0.04, 106.5, 0.5F, 4), to(-0.00025), et(1000)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  EXPECT_EQ(rig.sink.samples[0].utc, kDay + 1s - 250us);
}

TEST(GreisDecoder, TimeBasesOfTheDateAreHonoured) {
  const auto utc = [](U8 base) {
    Rig rig;
    rig.push({rt(20'000'000), rd(2026, 3, 14, base), pg(0.85, 0.04, 106.5, 0.5F, 4), et(20'000'000)});
    return rig.sink.samples.at(0).utc;
  };
  EXPECT_EQ(utc(0), kDay + 20'000s - 18s);
  EXPECT_EQ(utc(1), kDay + 20'000s);
  EXPECT_EQ(utc(2), kDay + 20'000s - 3h);
  EXPECT_EQ(utc(3), kDay + 20'000s);
}

TEST(GreisDecoder, TheDateIsCarriedThroughMidnightWithoutANewOne) {
  Rig rig;
  rig.push({rt(86'399'900), rd(2026, 3, 14, 1), pg(0.85, 0.04, 106.5, 0.5F, 4), et(86'399'900)});
  rig.push({rt(0), pg(0.85, 0.04, 106.5, 0.5F, 4), et(0)});
  ASSERT_EQ(rig.sink.samples.size(), 2U);
  EXPECT_EQ(rig.sink.samples[1].utc - rig.sink.samples[0].utc, Duration(100ms));
  EXPECT_EQ(rig.sink.samples[1].time - rig.sink.samples[0].time, Duration(100ms));
  EXPECT_EQ(rig.decoder.counters().samples_lost, 0U);
}

/// 2016-12-31T23:59:60Z is 2017-01-01 00:00:17 in GPS time, which does not pause: a second of UTC comes
/// twice.
TEST(GreisDecoder, TheLeapSecondIsInUtcAtItsInstantAndNotAtMidnightOfGpsTime) {
  Rig rig;
  for (const U32 tod_ms : {0U, 16'000U, 17'000U, 18'000U})
    rig.push({rt(tod_ms), rd(2017, 1, 1, 0), pg(0.85, 0.04, 106.5, 0.5F, 4), et(tod_ms)});
  ASSERT_EQ(rig.sink.samples.size(), 4U);
  const UtcTime new_year = std::chrono::sys_days{std::chrono::year{2017} / 1 / 1};
  EXPECT_EQ(rig.sink.samples[0].utc, new_year - 17s);
  EXPECT_EQ(rig.sink.samples[1].utc, new_year - 1s);
  EXPECT_EQ(rig.sink.samples[2].utc, new_year);
  EXPECT_EQ(rig.sink.samples[3].utc, new_year);
}

TEST(GreisDecoder, GpsTimeGivesTheDateWhereTheReceiverSentNone) {
  Rig rig;
  // Week 2409 of the GPS, 2026-03-08, as its ten bits.
  const Bytes gt = greis_message("GT", test::Body().put(U32{562'518'100}).put(U16{2409 % 1024}));
  const U32 tod = 562'518'100 % 86'400'000;
  rig.push({rt(tod), gt, pg(0.85, 0.04, 106.5, 0.5F, 4), et(tod)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const UtcTime week = std::chrono::sys_days{std::chrono::year{2026} / 3 / 8};
  EXPECT_EQ(rig.sink.samples[0].utc, week + 562'518'100ms - 18s);
}

TEST(GreisDecoder, TheReceiversOwnLeapSecondsOverrideTheConstant) {
  Rig rig;
  const Bytes uo = greis_message(
      "UO",
      test::Body().put(0.0).put(0.0F).put(U32{0}).put(U16{0}).put(U8{19}).put(U8{0}).put(U16{0}).put(U8{19}));
  rig.push({uo, rt(45'000'000), rd(2026, 3, 14, 0), pg(0.85, 0.04, 106.5, 0.5F, 4), et(45'000'000)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  EXPECT_EQ(rig.sink.samples[0].utc, kDay + 45'000s - 19s);
}

TEST(GreisDecoder, SolutionTypesAreTranslatedAndUndefinedOnesAreNone) {
  const auto solution = [](U8 type) {
    Rig rig;
    rig.push({rt(1000), pg(0.85, 0.04, 106.5, 0.5F, type), et(1000)});
    return rig.sink.samples.at(0).gnss;
  };
  EXPECT_EQ(solution(1).solution, GnssSolution::kSingle);
  EXPECT_EQ(solution(2).solution, GnssSolution::kDifferential);
  EXPECT_EQ(solution(3).solution, GnssSolution::kFloat);
  EXPECT_EQ(solution(4).solution, GnssSolution::kFixed);
  for (const U8 type : {U8{0}, U8{5}, U8{9}}) {
    EXPECT_EQ(solution(type).solution, GnssSolution::kNone);
    EXPECT_EQ(solution(type).flags, 0U);
  }
}

TEST(GreisDecoder, ValuesThatAreNotNumbersAreNotUsed) {
  Rig rig;
  rig.push({rt(1000), pg(0.85, 0.04, 106.5, NAN, 4), vg(NAN, 0.0F, 0.0F, 0.1F, 4), et(1000)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  EXPECT_EQ(rig.sink.samples[0].gnss.flags, kPositionValid);
}

TEST(GreisDecoder, ASphericalErrorProbableBecomesAnSdPerAxis) {
  Rig rig;
  rig.push({rt(1000), pg(0.85, 0.04, 106.5, 1.5381723F, 4), et(1000)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  for (const double sd : rig.sink.samples[0].gnss.sd_position_m) EXPECT_NEAR(sd, 1.0, 1e-6);
}

TEST(GreisDecoder, AnEpochThatLostBytesGivesNoSampleAndTheNextOneDoes) {
  for (int damage = 0; damage < 4; ++damage) {
    Rig rig;
    Bytes position = pg(0.85, 0.04, 106.5, 0.5F, 4);
    if (damage == 0) position[20] ^= 1;
    Bytes opening = rt(1100);
    if (damage == 1) opening[6] ^= 1;
    const Bytes closing = damage == 2 ? et(1000) : et(1100);
    rig.push({rt(1000), pg(0.85, 0.04, 106.5, 0.5F, 4), et(1000)});
    if (damage == 3) {
      rig.push({rt(1100), position});  // no ET
    } else {
      rig.push({opening, position, closing});
    }
    rig.push({rt(1200), pg(0.85, 0.04, 106.5, 0.5F, 4), et(1200)});
    // What is left of a damaged message may look like a longer one: only the end of the stream settles it.
    rig.decoder.finish({}, rig.sink);
    ASSERT_EQ(rig.sink.samples.size(), 2U) << damage;
    EXPECT_EQ(rig.decoder.counters().samples_lost, 1U) << damage;
    EXPECT_EQ(to_ns(rig.sink.samples[1].time), 1'200'000'000) << damage;
  }
}

TEST(GreisDecoder, EpochsThatCannotBeAreCountedAndGiveNoSample) {
  const Bytes position = pg(0.85, 0.04, 106.5, 0.5F, 4);
  Rig twice;
  for (int i = 0; i < 2; ++i) twice.push({rt(1000), position, et(1000)});
  EXPECT_EQ(twice.sink.samples.size(), 1U);
  EXPECT_EQ(twice.decoder.counters().bad_contents, 1U);

  Rig future;  // a solution of an epoch to come
  future.push({rt(1000), st(1100, 4), position, et(1000)});
  EXPECT_TRUE(future.sink.samples.empty());
  EXPECT_EQ(future.decoder.counters().bad_contents, 1U);

  Rig stale;
  stale.push({rt(40'000'000), st(1000, 4), position, et(40'000'000)});
  EXPECT_TRUE(stale.sink.samples.empty());

  Rig beyond_the_day;
  beyond_the_day.push({rt(86'400'000), position, et(86'400'000)});
  EXPECT_TRUE(beyond_the_day.sink.samples.empty());
  EXPECT_EQ(beyond_the_day.decoder.epochs_damaged(), 1U);
}

TEST(GreisDecoder, AClockOffsetThatCannotBeIsNotApplied) {
  for (const double offset_s : {1e9, static_cast<double>(NAN)}) {
    Rig rig;
    rig.push({rt(1000), rd(2026, 3, 14, 1), pg(0.85, 0.04, 106.5, 0.5F, 4), to(offset_s), et(1000)});
    ASSERT_EQ(rig.sink.samples.size(), 1U);
    EXPECT_EQ(rig.sink.samples[0].utc, kDay + 1s);
  }
}

TEST(GreisDecoder, APositionThatIsNotANumberIsNoSolution) {
  Rig rig;
  rig.push({rt(1000), pg(NAN, 0.04, 106.5, 0.5F, 4), vg(1.5F, -0.5F, 0.25F, 0.5F, 0), et(1000)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const GnssData& gnss = rig.sink.samples[0].gnss;
  EXPECT_EQ(gnss.solution, GnssSolution::kNone);
  EXPECT_EQ(gnss.flags, 0U);
  EXPECT_EQ((std::array{gnss.latitude_rad, gnss.longitude_rad, gnss.height_m}), (std::array{0.0, 0.0, 0.0}))
      << "what is no number goes no further, nor half of a position";
}

TEST(GreisDecoder, ADateThatCannotBeGivesNoUtc) {
  for (const auto& [month, base] : {std::pair<U8, U8>{13, 0}, std::pair<U8, U8>{3, 200}}) {
    Rig rig;
    rig.push({rt(1000), rd(2026, month, 14, base), pg(0.85, 0.04, 106.5, 0.5F, 4), et(1000)});
    ASSERT_EQ(rig.sink.samples.size(), 1U);
    EXPECT_FALSE(rig.sink.samples[0].has_utc) << int{month} << ' ' << int{base};
  }
}

TEST(GreisDecoder, APositionAndVelocityAlongTheAxesOfTheEarthAreThoseOfTheEllipsoid) {
  constexpr double kLat_rad = 0.85, kLon_rad = 0.04, kHeight_m = 106.5;
  // From the definition of geodetic coordinates, WGS-84.
  constexpr double kA_m = 6378137.0, kF = 1.0 / 298.257223563, kE2 = kF * (2.0 - kF);
  const double sin_lat = std::sin(kLat_rad), cos_lat = std::cos(kLat_rad);
  const double sin_lon = std::sin(kLon_rad), cos_lon = std::cos(kLon_rad);
  const double n_m = kA_m / std::sqrt(1.0 - kE2 * sin_lat * sin_lat);
  const std::array<double, 3> xyz_m{(n_m + kHeight_m) * cos_lat * cos_lon,
                                    (n_m + kHeight_m) * cos_lat * sin_lon,
                                    (n_m * (1.0 - kE2) + kHeight_m) * sin_lat};
  // Three metres a second north, two east, one down.
  const std::array<double, 3> v_mps{-3.0 * sin_lat * cos_lon - 2.0 * sin_lon - 1.0 * cos_lat * cos_lon,
                                    -3.0 * sin_lat * sin_lon + 2.0 * cos_lon - 1.0 * cos_lat * sin_lon,
                                    3.0 * cos_lat - 1.0 * sin_lat};
  Rig rig;
  rig.push({rt(1000), po(xyz_m, 0.5F, 4), ve(v_mps, 0.1F, 4), et(1000)});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const GnssData& gnss = rig.sink.samples[0].gnss;
  EXPECT_NEAR(gnss.latitude_rad, kLat_rad, 1e-12);
  EXPECT_NEAR(gnss.longitude_rad, kLon_rad, 1e-12);
  EXPECT_NEAR(gnss.height_m, kHeight_m, 1e-5);
  EXPECT_NEAR(gnss.v_n_mps[0], 3.0, 1e-6);
  EXPECT_NEAR(gnss.v_n_mps[1], 2.0, 1e-6);
  EXPECT_NEAR(gnss.v_n_mps[2], 1.0, 1e-6);
}

TEST(GreisDecoder, WhatTheLineDamagedIsCountedByItsKind) {
  Rig rig;
  const Bytes good = lines({rt(1000), pg(0.85, 0.04, 106.5, 0.5F, 4), et(1000)});
  rig.decoder.push(good, {}, rig.sink);
  const auto clean = rig.decoder.counters();
  EXPECT_EQ(clean.frames, 3U);
  EXPECT_EQ(clean.bytes_skipped + clean.bad_checksums + clean.bad_lengths, 0U);
  // One bit of the position, then bytes that are no message.
  Bytes damaged = lines({pg(0.85, 0.04, 106.5, 0.5F, 4)});
  damaged[20] ^= 0x01U;
  rig.decoder.push(damaged, {}, rig.sink);
  EXPECT_EQ(rig.decoder.counters().bad_checksums, 1U);
  rig.decoder.push(Bytes(40, std::uint8_t{0x81}), {}, rig.sink);
  rig.decoder.push(good, {}, rig.sink);
  // A false start waits for what it announced; at the end nothing more comes.
  rig.decoder.finish({}, rig.sink);
  EXPECT_GE(rig.decoder.counters().bytes_skipped, damaged.size() - 2 + 40U);
  EXPECT_EQ(rig.decoder.counters().frames, 2 * clean.frames);
  Rig impossible;
  impossible.decoder.push(good, {}, impossible.sink);
  impossible.decoder.push(bytes_of("PG000"), {}, impossible.sink);
  EXPECT_EQ(impossible.decoder.counters().bad_lengths, 1U);
}

// The rest of DP012<...> begins with what could be the header of a message of 0x12C bytes, for one.
TEST(GreisDecoder, ALineOpenedInTheMidstOfAMessageHasNoDamage) {
  Bytes epochs;
  for (const U32 tod : {1000U, 1100U, 1200U, 1300U}) {
    const Bytes epoch =
        lines({rt(tod), pg(0.85, 0.04, 106.5, 0.5F, 4),
               greis_message("DP", test::Body().put(0x43434343U).put(1.0F).put(1.0F).put(1.0F).put(U8{4})),
               et(tod)});
    epochs.insert(epochs.end(), epoch.begin(), epoch.end());
  }
  const std::size_t epoch_size = epochs.size() / 4;
  for (std::size_t cut = 1; cut < epoch_size; ++cut) {
    Rig rig;
    rig.decoder.push(std::span(epochs).subspan(cut), {}, rig.sink);
    rig.decoder.finish({}, rig.sink);
    const auto& counters = rig.decoder.counters();
    EXPECT_EQ(counters.bad_checksums + counters.bad_lengths, 0U) << cut;
    EXPECT_GE(counters.frames, 3U * 4U) << cut;
  }
}

TEST(GreisDecoder, MissingEpochsAreCountedByTime) {
  Rig rig;
  for (const U32 tod : {1000U, 1100U, 1500U}) rig.push({rt(tod), pg(0.85, 0.04, 106.5, 0.5F, 4), et(tod)});
  EXPECT_EQ(rig.sink.samples.size(), 3U);
  EXPECT_EQ(rig.decoder.counters().samples_lost, 3U);
}

TEST(GreisDecoder, TheEpochVectorGivesTheValuesOfItsMessages) {
  const auto vectors = load_vectors(source_path("tests/vectors/greis.hex"));
  Rig rig;
  rig.decoder.push(vector_named(vectors, "epoch"), {}, rig.sink);
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const GnssData& gnss = rig.sink.samples[0].gnss;
  EXPECT_EQ(gnss.solution, GnssSolution::kFixed);
  EXPECT_EQ(gnss.latitude_rad, 0.8527264415590355);
  EXPECT_EQ(gnss.height_m, 106.66247083619237);
  EXPECT_EQ(rig.sink.samples[0].utc, kDay + 45'000'100ms + 250us);  // base UTC, TO 0.25 ms
}

TEST(GreisDecoder, TheJavadLogWithoutEpochEndsGivesItsCompleteEpochs) {
  IMUSCOPE_NEEDS_SHARED("data/streams/greis/javad.jps");
  DecoderConfig config = fixed_config();
  config.period = 1s;
  Rig rig(config);
  const Bytes bytes = load_bytes(shared_path("data/streams/greis/javad.jps"));
  for (std::size_t at = 0; at < bytes.size(); at += 1000) {
    const std::size_t n = std::min<std::size_t>(1000, bytes.size() - at);
    rig.decoder.push(std::span(bytes).subspan(at, n), {}, rig.sink);
  }
  rig.decoder.finish({}, rig.sink);
  EXPECT_EQ(rig.decoder.epochs(), 130U);
  EXPECT_EQ(rig.decoder.epochs_damaged(), 1U);  // the last one, cut by the end of the file
  ASSERT_EQ(rig.sink.samples.size(), 129U);
  EXPECT_EQ(rig.decoder.counters().samples_lost, 0U);
  for (const Sample& sample : rig.sink.samples) {
    EXPECT_EQ(sample.gnss.solution, GnssSolution::kSingle);
    EXPECT_EQ(sample.gnss.flags & (kPositionValid | kVelocityValid), kPositionValid | kVelocityValid);
    EXPECT_LT(std::hypot(sample.gnss.v_n_mps[0], sample.gnss.v_n_mps[1], sample.gnss.v_n_mps[2]), 0.2);
  }
  // The first epoch's [RD] 2011-01-15, base GPS, and [RT] 8803.000 s; its [UO] has 15 leap
  // seconds, its [TO] -0.2448 ms.
  const UtcTime day = std::chrono::sys_days{std::chrono::year{2011} / 1 / 15};
  EXPECT_NEAR(to_seconds(rig.sink.samples[0].utc - day), 8803.0 - 15.0 - 0.0002448, 1e-7);
}

}  // namespace
}  // namespace imuscope::greis
