// Messages of ROS as frames, and samples made of them.
#include "drivers/ros_message/decoder.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/drivers/support/streams.h"

namespace imuscope::ros_message {
namespace {

using test::Bytes;
using namespace std::chrono_literals;

constexpr std::int64_t kBegin_ns = 1'700'000'000'000'000'000;

Bytes frame_of(const Content& content) {
  Bytes frame(kFrameMost);
  frame.resize(write_frame(content, frame));
  return frame;
}

Content imu_at(Duration after) {
  return {Kind::kImu, kHasGyro | kHasAccel, kBegin_ns + after.count(), {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}};
}

Content solution(GnssSolution solution, unsigned flags) {
  return {Kind::kGnss,
          static_cast<std::uint8_t>(static_cast<unsigned>(solution) | flags),
          kBegin_ns,
          {0.85, 0.04, 106.5, 0.01, 0.02, 0.03, 1.5, -0.5, 0.25, 0.1, 0.2, 0.3}};
}

struct Rig {
  explicit Rig(const DecoderConfig& config = {}) : decoder(config) {}
  std::vector<Sample>& push(std::initializer_list<Content> contents) {
    for (const Content& content : contents) decoder.push(frame_of(content), {}, sink);
    decoder.finish({}, sink);
    return sink.samples;
  }
  Decoder decoder;
  test::CollectingSink sink;
};

TEST(RosMessageFrame, ComesBackAsItWasWrittenWithTheValuesOfItsKind) {
  Content content;
  content.flags = 0x25;
  content.time_ns = -kBegin_ns;
  for (std::size_t i = 0; i < kValuesMost; ++i) content.values[i] = 1.5 + static_cast<double>(i);
  for (const Kind kind : {Kind::kImu, Kind::kGnss, Kind::kSpeed, Kind::kTimeReference}) {
    content.kind = kind;
    const Bytes frame = frame_of(content);
    EXPECT_EQ(frame.size(), kHeadBytes + value_count(kind) * sizeof(double) + kChecksumBytes);
    const Content back = read_frame(frame);
    EXPECT_EQ(back.kind, kind);
    EXPECT_EQ(back.flags, content.flags);
    EXPECT_EQ(back.time_ns, content.time_ns);
    for (std::size_t i = 0; i < kValuesMost; ++i)
      EXPECT_EQ(back.values[i], i < value_count(kind) ? content.values[i] : 0.0) << i;
  }
}

TEST(RosMessageDecoder, AnImuBecomesASampleInTheDevicesAxes) {
  DecoderConfig config;
  config.device = 3;
  config.axes = {0, 1, 0, 1, 0, 0, 0, 0, -1};
  Rig rig(config);
  const auto& samples = rig.push({imu_at(0ms)});
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].kind, SampleKind::kImu);
  EXPECT_EQ(samples[0].device, 3);
  EXPECT_EQ(to_ns(samples[0].time), kBegin_ns);
  EXPECT_EQ(samples[0].imu.omega_radps, (Vector3{0.2, 0.1, -0.3}));
  EXPECT_EQ(samples[0].imu.f_mps2, (Vector3{2.0, 1.0, -9.8}));
  EXPECT_EQ(samples[0].imu.flags, kGyroValid | kAccelValid);
  EXPECT_FALSE(samples[0].has_utc);
}

TEST(RosMessageDecoder, MissingSamplesAreCountedByTime) {
  DecoderConfig config;
  config.period = 10ms;
  Rig rig(config);
  const auto& samples = rig.push({imu_at(0ms), imu_at(10ms), imu_at(24ms), imu_at(64ms)});
  ASSERT_EQ(samples.size(), 4U);
  EXPECT_EQ(rig.decoder.counters().samples_lost, 3U);
  EXPECT_EQ(samples[1].imu.flags & kGapBefore, 0U);
  EXPECT_EQ(samples[2].imu.flags & kGapBefore, 0U) << "late, with none missing";
  EXPECT_EQ(samples[3].imu.flags & kGapBefore, kGapBefore);

  Rig unknown;  // of a period that is not known no gap is told
  EXPECT_EQ(unknown.push({imu_at(0ms), imu_at(10s)}).size(), 2U);
  EXPECT_EQ(unknown.decoder.counters().samples_lost, 0U);
}

TEST(RosMessageDecoder, ATimeThatGoesBackIsLeftOutWithARemedy) {
  Rig rig;
  EXPECT_TRUE(rig.decoder.remark().empty());
  EXPECT_EQ(rig.push({imu_at(10ms), imu_at(9ms), imu_at(10ms)}).size(), 2U);
  EXPECT_EQ(rig.decoder.counters().bad_contents, 1U);
  EXPECT_NE(rig.decoder.remark().find("mcap.time"), std::string_view::npos);
}

TEST(RosMessageDecoder, ASolutionHasWhatItsFlagsSay) {
  const auto gnss_of = [](GnssSolution kind, unsigned flags) {
    Rig rig;
    return rig.push({solution(kind, flags)}).at(0).gnss;
  };
  const GnssData all = gnss_of(GnssSolution::kFixed, kHasSdPosition | kHasVelocity | kHasSdVelocity);
  EXPECT_EQ(all.solution, GnssSolution::kFixed);
  EXPECT_EQ(all.latitude_rad, 0.85);
  EXPECT_EQ(all.longitude_rad, 0.04);
  EXPECT_EQ(all.height_m, 106.5);
  EXPECT_EQ(all.sd_position_m, (Vector3{0.01, 0.02, 0.03}));
  EXPECT_EQ(all.v_n_mps, (Vector3{1.5, -0.5, 0.25}));
  EXPECT_EQ(all.sd_velocity_mps, (Vector3{0.1, 0.2, 0.3}));
  EXPECT_EQ(all.flags, kPositionValid | kHasPositionSd | kVelocityValid | kHasVelocitySd);
  EXPECT_EQ(gnss_of(GnssSolution::kSingle, kHasVelocity).flags, kPositionValid | kVelocityValid);
  EXPECT_EQ(gnss_of(GnssSolution::kSingle, kHasSdPosition).flags, kPositionValid | kHasPositionSd);
  EXPECT_EQ(gnss_of(GnssSolution::kSingle, kHasSdVelocity).flags, kPositionValid)
      << "without a velocity there is none to be sure of";
  EXPECT_EQ(gnss_of(GnssSolution::kNone, kHasSdPosition | kHasVelocity).flags, 0U);
}

TEST(RosMessageDecoder, ASpeedAndAPulseAreTaken) {
  Rig rig;
  const auto& samples = rig.push({{Kind::kSpeed, 0, kBegin_ns, {12.5}},
                                  {Kind::kTimeReference, 0, kBegin_ns + 1'000'000, {0.25, 1.6e9}}});
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].kind, SampleKind::kOdometry);
  EXPECT_EQ(samples[0].odometry.speed_mps, 12.5);
  EXPECT_EQ(samples[1].kind, SampleKind::kPulse);
  EXPECT_EQ(samples[1].pulse.wall_ns, 1'600'000'000'000'000'000);
  EXPECT_EQ(to_ns(samples[1].time), kBegin_ns + 1'000'000 - 250'000'000) << "the whole second before it";
}

TEST(RosMessageDecoder, WhatCannotBeIsCountedAndTheNextMessageIsRead) {
  Content place = solution(GnssSolution::kFixed, 0);
  place.values[0] = 1.6;  // beyond the pole
  Content turn = solution(GnssSolution::kFixed, 0);
  turn.values[1] = 6.3;
  Content number = imu_at(0ms);
  number.values[4] = NAN;
  const Content kind = solution(static_cast<GnssSolution>(kSolutionBits), 0);
  Content time = imu_at(0ms);
  time.time_ns = std::int64_t{4'000'000'001} * 1'000'000'000;
  const Content second{Kind::kTimeReference, 0, kBegin_ns, {0.6, 1.6e9}};
  for (const Content& bad : {place, turn, number, kind, time, second}) {
    Rig rig;
    EXPECT_EQ(rig.push({bad, imu_at(0ms)}).size(), 1U);
    EXPECT_EQ(rig.decoder.counters().bad_contents, 1U);
    EXPECT_EQ(rig.decoder.counters().frames, 2U);
  }
}

TEST(RosMessageDecoder, ADamagedFrameIsCountedAndTheNextOneIsRead) {
  Bytes damaged = frame_of(imu_at(0ms));
  damaged[20] ^= 0x01U;
  Bytes no_kind = frame_of(imu_at(0ms));
  no_kind[4] = 9;
  Rig rig;
  rig.push({imu_at(0ms)});
  rig.decoder.push(damaged, {}, rig.sink);
  rig.decoder.push(no_kind, {}, rig.sink);
  EXPECT_EQ(rig.push({imu_at(10ms)}).size(), 2U);
  EXPECT_EQ(rig.decoder.counters().bad_checksums, 1U);
  EXPECT_EQ(rig.decoder.counters().bad_lengths, 1U);
  EXPECT_EQ(rig.decoder.counters().bytes_skipped, damaged.size() + no_kind.size());
}

}  // namespace
}  // namespace imuscope::ros_message
