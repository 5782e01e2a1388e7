// UBX messages, damaged streams, NAV-PVT to samples.
#include <gtest/gtest.h>
#include <cmath>
#include <numbers>

#include "base/units.h"
#include "drivers/ubx/decoder.h"
#include "drivers/ubx/session.h"
#include "tests/drivers/support/streams.h"
#include "tests/drivers/ubx/message_builder.h"
#include "tests/support/shared_data.h"

namespace imuscope::ubx {
namespace {

using nlohmann::json;
using test::Bytes;
using namespace std::chrono_literals;

std::vector<Bytes> scan(std::span<const Bytes> reads) {
  Scanner scanner;
  std::vector<Bytes> frames;
  Frame frame;
  for (const Bytes& read : reads) {
    std::span<const std::uint8_t> rest(read);
    while (!rest.empty()) {
      rest = rest.subspan(scanner.append(rest, {}));
      while (scanner.next(frame)) frames.emplace_back(frame.bytes.begin(), frame.bytes.end());
    }
  }
  while (scanner.next(frame, true)) frames.emplace_back(frame.bytes.begin(), frame.bytes.end());
  return frames;
}

struct Rig {
  explicit Rig(DecoderConfig config = {})
      : decoder((config.clock = ClockMapConfig::fixed({}, 1.0), config)) {}
  void push(const Bytes& bytes) { decoder.push(bytes, {}, sink); }
  Decoder decoder;
  test::CollectingSink sink;
};

TEST(UbxVectors, EveryVectorDecodesToItsPublishedValues) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/ubx_nav_pvt.hex"));
  const json expected = test::load_json(test::source_path("tests/vectors/ubx_nav_pvt.json"));
  ASSERT_EQ(vectors.size(), expected["vectors"].size());
  for (const json& vector : expected["vectors"]) {
    const std::string name = vector["name"];
    SCOPED_TRACE(name);
    const Bytes reads[] = {test::vector_named(vectors, name)};
    ASSERT_EQ(reads[0].size(), vector["length"]);
    const auto frames = scan(reads);
    if (vector.value("valid", true) == false) {
      EXPECT_TRUE(frames.empty());
      continue;
    }
    ASSERT_EQ(frames.size(), 1U);
    Rig rig;
    rig.push(frames[0]);
    ASSERT_EQ(rig.sink.samples.size(), 1U);
    if (!vector.contains("fields")) continue;
    json fields = json::object();
    const auto payload = std::span(frames[0]).subspan(kHeaderSize);
    for_each_field(parse_nav_pvt(payload),
                   [&](std::string_view field, double value) { fields[std::string(field)] = value; });
    for (const auto& [field, value] : fields.items()) {
      EXPECT_EQ(value.get<double>(), vector["fields"].at(field).get<double>()) << field;
    }
  }
}

TEST(UbxVectors, AnRtkFixBecomesASampleWithTheSecondBeforeItsNegativeNanoseconds) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/ubx_nav_pvt.hex"));
  Rig rig;
  rig.push(test::vector_named(vectors, "nav_pvt_rtk_fixed"));
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const Sample& sample = rig.sink.samples[0];
  EXPECT_EQ(sample.gnss.solution, GnssSolution::kFixed);
  EXPECT_NEAR(sample.gnss.latitude_rad / kRadPerDeg, 48.856614, 1e-12);
  EXPECT_NEAR(sample.gnss.longitude_rad / kRadPerDeg, 2.352219, 1e-12);
  EXPECT_DOUBLE_EQ(sample.gnss.height_m, 81.5);
  EXPECT_EQ(sample.gnss.v_n_mps, (Vector3{1.25, -0.5, -0.125}));
  EXPECT_NEAR(sample.gnss.sd_position_m[0], 0.014 / std::numbers::sqrt2, 1e-12);
  EXPECT_NEAR(sample.gnss.sd_velocity_mps[0], 0.05 / std::numbers::sqrt3, 1e-12);
  const UtcTime day = std::chrono::sys_days{std::chrono::year{2026} / 3 / 14};
  EXPECT_EQ(sample.utc, day + 15h + 29min + 41s + Duration(999'900'100));

  Rig none;
  none.push(test::vector_named(vectors, "nav_pvt_no_fix"));
  ASSERT_EQ(none.sink.samples.size(), 1U);
  EXPECT_EQ(none.sink.samples[0].gnss.flags, 0U);
  EXPECT_FALSE(none.sink.samples[0].has_utc);
}

TEST(UbxDecoder, TheWeekOfTheGpsIsUnwrappedAndMissingEpochsAreCounted) {
  const auto pvt = [](std::uint32_t itow_ms) {
    Bytes payload(92, 0);
    for (std::size_t i = 0; i < 4; ++i) payload[i] = static_cast<std::uint8_t>(itow_ms >> (8 * i));
    return test::ubx_message(1, 7, payload);
  };
  DecoderConfig config;
  config.period = 100ms;
  Rig rig(config);
  for (const std::uint32_t itow_ms : {604'799'900U, 0U, 400U, 400U}) rig.push(pvt(itow_ms));
  ASSERT_EQ(rig.sink.samples.size(), 3U);
  EXPECT_EQ(rig.sink.samples[1].time - rig.sink.samples[0].time, Duration(100ms));
  EXPECT_EQ(rig.sink.samples[2].time - rig.sink.samples[1].time, Duration(400ms));
  EXPECT_EQ(rig.decoder.counters().samples_lost, 3U);
  EXPECT_EQ(rig.decoder.counters().bad_contents, 1U);  // the same epoch again
}

/// A good solution with one byte after the other changed.
Bytes altered(std::initializer_list<std::pair<std::size_t, int>> changes) {
  const Bytes good = test::ubx_nav_pvt(1000);
  Bytes payload(good.begin() + kHeaderSize, good.end() - kChecksumSize);
  for (const auto& [at, value] : changes) payload[at] = static_cast<std::uint8_t>(value);
  return test::ubx_message(1, 7, payload);
}

Sample one_sample(const Bytes& message) {
  Rig rig;
  rig.push(message);
  return rig.sink.samples.at(0);
}

TEST(UbxDecoder, TheSolutionIsOfTheFixItsFlagsAndTheCarrierPhase) {
  static constexpr std::size_t kFixAt = 20, kFlagsAt = 21;
  const auto solution = [](int fix, int flags) {
    return one_sample(altered({{kFixAt, fix}, {kFlagsAt, flags}})).gnss.solution;
  };
  EXPECT_EQ(solution(3, 0x01), GnssSolution::kSingle);
  EXPECT_EQ(solution(3, 0x03), GnssSolution::kDifferential);
  EXPECT_EQ(solution(3, 0x43), GnssSolution::kFloat);
  EXPECT_EQ(solution(3, 0x83), GnssSolution::kFixed);
  EXPECT_EQ(solution(4, 0x01), GnssSolution::kSingle);
  EXPECT_EQ(solution(3, 0x82), GnssSolution::kNone) << "the receiver itself does not trust it";
  EXPECT_EQ(solution(2, 0x01), GnssSolution::kNone) << "a plane has no height";
  EXPECT_EQ(solution(1, 0x01), GnssSolution::kNone) << "dead reckoning is not of satellites";
}

TEST(UbxDecoder, AccuraciesOfZeroAreNone) {
  constexpr std::size_t kHorizontalAt = 40, kVerticalAt = 44, kSpeedAt = 68;
  const auto flags = [](std::size_t at) { return one_sample(altered({{at, 0}})).gnss.flags; };
  constexpr std::uint32_t kBoth = kPositionValid | kVelocityValid;
  EXPECT_EQ(flags(kHorizontalAt), kBoth | kHasVelocitySd);
  EXPECT_EQ(flags(kVerticalAt), kBoth | kHasVelocitySd);
  EXPECT_EQ(flags(kSpeedAt), kBoth | kHasPositionSd);
}

TEST(UbxDecoder, UtcNeedsAValidDateAndTimeThatCanBe) {
  constexpr std::size_t kMonthAt = 6, kValidAt = 11;
  EXPECT_TRUE(one_sample(altered({})).has_utc);
  EXPECT_FALSE(one_sample(altered({{kMonthAt, 13}})).has_utc);
  EXPECT_FALSE(one_sample(altered({{kValidAt, 0x01}})).has_utc);
  EXPECT_FALSE(one_sample(altered({{kValidAt, 0x02}})).has_utc);
}

TEST(UbxDecoder, AShortMessageAndATimeBeyondTheWeekAreCounted) {
  Rig rig;
  rig.push(test::ubx_message(1, 7, Bytes(kPvtMin - 1, 0)));
  EXPECT_TRUE(rig.sink.samples.empty());
  EXPECT_EQ(rig.decoder.counters().bad_contents, 1U);
  rig.push(test::ubx_nav_pvt(604'800'000));
  EXPECT_TRUE(rig.sink.samples.empty());
  EXPECT_EQ(rig.decoder.counters().bad_contents, 2U);
  rig.push(test::ubx_nav_pvt(604'799'999));
  EXPECT_EQ(rig.sink.samples.size(), 1U);
}

TEST(UbxDecoder, AnEpochFromBeforeTheWeeksEndStepsBackAndNotAWeekForward) {
  Rig rig;
  rig.push(test::ubx_nav_pvt(100));
  rig.push(test::ubx_nav_pvt(604'799'900));
  ASSERT_EQ(rig.sink.samples.size(), 2U);
  EXPECT_EQ(rig.sink.samples[1].time - rig.sink.samples[0].time, Duration(-200ms));
}

TEST(UbxSession, OnlyNavPvtIsWhatItWaitsFor) {
  const HostTime begin = host_time_from_ns(0);
  Session session;
  (void)session.poll(begin);
  (void)session.poll(begin + 6s);
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_NE(session.problem().find("cable"), std::string_view::npos);
  session.on_bytes(test::ubx_message(1, 0x35, Bytes(100, 0)), begin + 7s);  // NAV-SAT
  session.on_bytes(test::ubx_message(2, 7, Bytes(100, 0)), begin + 7s);
  (void)session.poll(begin + 8s);
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_NE(session.problem().find("UBX-NAV-PVT"), std::string_view::npos);
  session.on_bytes(test::ubx_nav_pvt(1000), begin + 9s);
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_EQ(session.problem(), "");
}

TEST(UbxDecoder, WhatTheLineDamagedIsCountedByItsKind) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/ubx_nav_pvt.hex"));
  const Bytes& good = vectors.front().bytes;
  Bytes damaged = good;
  damaged[10] ^= 0x01U;
  const Bytes endless{0xB5, 0x62, 0x01, 0x07, 0xFF, 0xFF};  // a payload longer than any message's
  Rig rig;
  for (const Bytes& bytes : {good, damaged, endless, good}) rig.push(bytes);
  rig.decoder.finish({}, rig.sink);
  EXPECT_EQ(rig.decoder.counters().bad_checksums, 1U);
  EXPECT_EQ(rig.decoder.counters().bad_lengths, 1U);
  EXPECT_EQ(rig.decoder.counters().bytes_skipped, damaged.size() + endless.size());
  EXPECT_EQ(rig.decoder.counters().frames, 2U);
}

TEST(UbxCapture, TheWalkWithNmeaMixedInLosesNoByte) {
  IMUSCOPE_NEEDS_SHARED("data/streams/ubx/walk.ubx");
  const Bytes bytes = test::load_bytes(test::shared_path("data/streams/ubx/walk.ubx"));
  Scanner scanner;
  Frame frame;
  std::size_t messages = 0, sentences = 0;
  std::span<const std::uint8_t> rest(bytes);
  while (!rest.empty()) {
    rest = rest.subspan(scanner.append(rest, {}));
    while (scanner.next(frame)) ++(frame.kind == Frame::Kind::kMessage ? messages : sentences);
  }
  // Counted by a walk over the file in another language, checksums included; 536 of the messages are NAV-PVT.
  EXPECT_EQ(scanner.counters().bytes_skipped, 0U);
  EXPECT_EQ(messages, 3400U);
  EXPECT_EQ(sentences, 2010U);
  Rig rig;
  rig.push(bytes);
  EXPECT_EQ(rig.sink.samples.size(), 536U);
}

}  // namespace
}  // namespace imuscope::ubx
