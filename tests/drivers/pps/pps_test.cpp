/// Pulses as records: bytes laid down here by the description in pulse_record.h, and a decoder that believes
/// none that cannot be.

#include <gtest/gtest.h>

#include <array>
#include <chrono>

#include "drivers/pps/decoder.h"
#include "drivers/pps/session.h"
#include "tests/drivers/support/streams.h"

namespace imuscope::pps {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::Bytes;

// "PPSa", count 258, 1000.000000123 s, 2026-03-14T09:30:00 UTC, 60 ns apart.
const Bytes kRecord{'P',  'P',  'S',  'a',  0x02, 0x01, 0,    0,    0x7B, 0x10, 0xA5,
                    0xD4, 0xE8, 0x00, 0x00, 0x00, 0x00, 0xF0, 0x0B, 0x9B, 0x35, 0xAB,
                    0x9C, 0x18, 60,   0,    0,    0,    0,    0,    0,    0};

Bytes record(std::uint32_t sequence, HostTime time, Duration apart = Duration{60}) {
  Bytes bytes(kPulseRecordBytes);
  write_pulse_record({PulseEdge::kAssert, sequence, time, utc_time_from_ns(1'773'480'600'000'000'000), apart},
                     bytes);
  return bytes;
}

TEST(PulseRecord, IsLaidOutAsDescribed) {
  const auto pulse = read_pulse_record(kRecord);
  ASSERT_TRUE(pulse);
  EXPECT_EQ(pulse->edge, PulseEdge::kAssert);
  EXPECT_EQ(pulse->sequence, 258U);
  EXPECT_EQ(to_ns(pulse->time), 1'000'000'000'123);
  EXPECT_EQ(pulse->apart, Duration{60});
  Bytes again(kPulseRecordBytes);
  EXPECT_EQ(write_pulse_record(*pulse, again), kPulseRecordBytes);
  EXPECT_EQ(again, kRecord);
}

TEST(PulseRecord, IsNotReadWhereABitOfItsFrameIsWrong) {
  for (const std::size_t at : {0U, 1U, 2U, 3U, 28U, 31U}) {
    Bytes wrong = kRecord;
    wrong[at] ^= 0x80U;
    EXPECT_FALSE(read_pulse_record(wrong)) << at;
  }
  EXPECT_FALSE(read_pulse_record(std::span(kRecord).first(31)));
}

// "PPSq", 60 ns apart, 1000.000000123 s, by the quartz 77000 s later, -12.345 ppm.
const Bytes kSteeringRecord{'P',  'P',  'S',  'q',  60,   0,    0,    0,    0x7B, 0x10, 0xA5,
                            0xD4, 0xE8, 0x00, 0x00, 0x00, 0x7B, 0xE0, 0x4A, 0xCA, 0xF0, 0x46,
                            0x00, 0x00, 0xC7, 0xCF, 0xFF, 0xFF, 0,    0,    0,    0};

TEST(SteeringRecord, IsLaidOutAsDescribedAndNoPulse) {
  const auto steering = read_steering_record(kSteeringRecord);
  ASSERT_TRUE(steering);
  EXPECT_EQ(to_ns(steering->time), 1'000'000'000'123);
  EXPECT_EQ(to_ns(steering->unsteered), 78'000'000'000'123);
  EXPECT_NEAR(steering->rate, -12.345e-6, 1e-15);
  EXPECT_EQ(steering->apart, Duration{60});
  Bytes again(kPulseRecordBytes);
  EXPECT_EQ(write_steering_record(*steering, again), kPulseRecordBytes);
  EXPECT_EQ(again, kSteeringRecord);
  EXPECT_FALSE(read_pulse_record(kSteeringRecord));
  EXPECT_FALSE(read_steering_record(kRecord));
  for (const std::size_t at : {0U, 3U, 27U, 31U}) {
    Bytes wrong = kSteeringRecord;
    wrong[at] ^= 0x40U;
    EXPECT_FALSE(read_steering_record(wrong)) << at;
  }
}

TEST(PpsDecoder, GivesHowTheClockIsSteeredBesideThePulses) {
  Decoder decoder({3});
  test::CollectingSink sink;
  const HostTime read = host_time_from_ns(1'000'000'000'123) + milliseconds(1);
  Bytes both = kSteeringRecord;
  both.insert(both.end(), kRecord.begin(), kRecord.end());
  decoder.push(both, read, sink);
  ASSERT_EQ(sink.samples.size(), 2U);
  EXPECT_EQ(sink.samples[0].kind, SampleKind::kSteering);
  EXPECT_EQ(sink.samples[0].steering.unsteered_ns, 78'000'000'000'123);
  EXPECT_NEAR(sink.samples[0].steering.rate, -12.345e-6, 1e-15);
  EXPECT_EQ(sink.samples[1].kind, SampleKind::kPulse);
  EXPECT_EQ(sink.samples[1].sequence, 1U);
  EXPECT_EQ(decoder.counters().samples_lost, 0U);
  decoder.push(kSteeringRecord, read + seconds(60), sink);  // of long ago
  EXPECT_EQ(decoder.counters().bad_contents, 1U);
}

TEST(PpsSession, StreamsByPulsesAlone) {
  Session session;
  const HostTime begin = host_time_from_ns(1'000'000'000'000);
  EXPECT_TRUE(session.poll(begin).empty());
  session.on_bytes(kSteeringRecord, begin + seconds(1));
  EXPECT_EQ(session.state(), SessionState::kConnecting);
  Bytes both = kSteeringRecord;
  both.insert(both.end(), kRecord.begin(), kRecord.end());
  session.on_bytes(both, begin + seconds(2));
  EXPECT_EQ(session.state(), SessionState::kStreaming);
}

TEST(PpsDecoder, GivesAPulseItsTimeAndCountsThoseThatAreMissing) {
  Decoder decoder({3});
  test::CollectingSink sink;
  const HostTime first = host_time_from_ns(1'000'000'000'000);
  for (const std::uint32_t k : {10U, 11U, 14U}) {
    const HostTime time = first + seconds(k);
    decoder.push(record(k, time), time + milliseconds(90), sink);
  }
  ASSERT_EQ(sink.samples.size(), 3U);
  EXPECT_EQ(sink.samples[2].kind, SampleKind::kPulse);
  EXPECT_EQ(sink.samples[2].device, 3);
  EXPECT_EQ(sink.samples[2].sequence, 2U);
  EXPECT_EQ(sink.samples[2].time, first + seconds(14));
  EXPECT_EQ(sink.samples[2].arrival, first + seconds(14) + milliseconds(90));
  EXPECT_FALSE(sink.samples[2].has_utc);
  EXPECT_EQ(sink.samples[2].pulse.wall_ns, 1'773'480'600'000'000'000);
  EXPECT_EQ(decoder.counters().samples_lost, 2U);
}

TEST(PpsDecoder, BelievesNoPulseThatCannotBe) {
  Decoder decoder({0});
  test::CollectingSink sink;
  const HostTime now = host_time_from_ns(1'000'000'000'000);
  decoder.push(record(1, now + milliseconds(1)), now, sink);  // after its read
  decoder.push(record(2, now - seconds(60)), now, sink);      // of long ago
  decoder.push(record(3, now - milliseconds(50), milliseconds(1)), now,
               sink);  // the clocks were not read together
  EXPECT_TRUE(sink.samples.empty());
  EXPECT_EQ(decoder.counters().bad_contents, 3U);
  decoder.push(record(4, now - milliseconds(50)), now, sink);
  decoder.push(record(4, now - milliseconds(50)), now, sink);  // again
  EXPECT_EQ(sink.samples.size(), 1U);
  Bytes damaged = record(5, now);
  damaged[0] = 'Q';
  decoder.push(damaged, now, sink);
  EXPECT_EQ(decoder.counters().bytes_skipped, kPulseRecordBytes);
  EXPECT_EQ(sink.samples.size(), 1U);
}

TEST(PpsSession, StreamsWithTheFirstPulseAndTellsWhereNoneComes) {
  Session session;
  const HostTime begin = host_time_from_ns(1'000'000'000'000);
  EXPECT_TRUE(session.poll(begin).empty());
  EXPECT_EQ(session.state(), SessionState::kConnecting);
  session.on_bytes(kRecord, begin + seconds(1));
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_TRUE(session.poll(begin + seconds(5)).empty());
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_NE(session.problem().find("fix"), std::string_view::npos);
}

}  // namespace
}  // namespace imuscope::pps
