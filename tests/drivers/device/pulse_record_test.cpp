/// Records of pulses and of the clock's steering, byte by byte as the header lays them down, and what is no record.

#include "drivers/device/pulse_record.h"

#include <gtest/gtest.h>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

namespace imuscope {
namespace {

using Record = std::array<std::uint8_t, kPulseRecordBytes>;

constexpr std::int64_t kInstantMax_ns = std::numeric_limits<std::int64_t>::max() / 4;

const UtcPulse kPulse{PulseEdge::kClear, 0x01020304, host_time_from_ns(0x0102030405060708),
                      utc_time_from_ns(0x1112131415161718), Duration{0x21222324}};
const Record kPulseBytes{'P',  'P',  'S',  'c',  0x04, 0x03, 0x02, 0x01, 0x08, 0x07, 0x06,
                         0x05, 0x04, 0x03, 0x02, 0x01, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13,
                         0x12, 0x11, 0x24, 0x23, 0x22, 0x21, 0,    0,    0,    0};

const ClockSteering kSteering{host_time_from_ns(0x0102030405060708), host_time_from_ns(0x1112131415161718),
                              -5e-6, Duration{0x21222324}};
const Record kSteeringBytes{'P',  'P',  'S',  'q',  0x24, 0x23, 0x22, 0x21, 0x08, 0x07, 0x06,
                            0x05, 0x04, 0x03, 0x02, 0x01, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13,
                            0x12, 0x11, 0x78, 0xEC, 0xFF, 0xFF, 0,    0,    0,    0};

/// What a steering of `rate` is read as.
double read_back(double rate) {
  Record bytes{};
  EXPECT_EQ(write_steering_record({HostTime{}, HostTime{}, rate, Duration{}}, bytes), kPulseRecordBytes);
  return read_steering_record(bytes).value().rate;
}

TEST(PulseRecord, APulseIsItsBytes) {
  Record bytes;
  bytes.fill(0xEE);
  EXPECT_EQ(write_pulse_record(kPulse, bytes), kPulseRecordBytes);
  EXPECT_EQ(bytes, kPulseBytes);
  const UtcPulse read = read_pulse_record(bytes).value();
  EXPECT_EQ(read.edge, PulseEdge::kClear);
  EXPECT_EQ(read.sequence, kPulse.sequence);
  EXPECT_EQ(read.time, kPulse.time);
  EXPECT_EQ(read.wall, kPulse.wall);
  EXPECT_EQ(read.apart, kPulse.apart);
  EXPECT_FALSE(read_steering_record(bytes)) << "it is no steering";
  UtcPulse assert_edge = kPulse;
  assert_edge.edge = PulseEdge::kAssert;
  EXPECT_EQ(write_pulse_record(assert_edge, bytes), kPulseRecordBytes);
  EXPECT_EQ(bytes[3], 'a');
  EXPECT_EQ(read_pulse_record(bytes).value().edge, PulseEdge::kAssert);
}

TEST(PulseRecord, SteeringIsItsBytes) {
  Record bytes;
  bytes.fill(0xEE);
  EXPECT_EQ(write_steering_record(kSteering, bytes), kPulseRecordBytes);
  EXPECT_EQ(bytes, kSteeringBytes);
  const ClockSteering read = read_steering_record(bytes).value();
  EXPECT_EQ(read.time, kSteering.time);
  EXPECT_EQ(read.unsteered, kSteering.unsteered);
  EXPECT_DOUBLE_EQ(read.rate, kSteering.rate);
  EXPECT_EQ(read.apart, kSteering.apart);
  EXPECT_FALSE(read_pulse_record(bytes)) << "it is no pulse";
}

TEST(PulseRecord, ARateIsKeptToANanosecondASecondUpToAFifth) {
  EXPECT_DOUBLE_EQ(read_back(1.4e-9), 1e-9);
  EXPECT_DOUBLE_EQ(read_back(-1.6e-9), -2e-9);
  EXPECT_DOUBLE_EQ(read_back(0.2), 0.2);
  EXPECT_DOUBLE_EQ(read_back(0.3), 0.2);
  EXPECT_DOUBLE_EQ(read_back(-1.0), -0.2);
  Record bytes = kSteeringBytes;
  const std::uint32_t beyond = 200'000'001;
  for (std::size_t i = 0; i < 4; ++i) bytes[24 + i] = static_cast<std::uint8_t>(beyond >> (8 * i));
  EXPECT_FALSE(read_steering_record(bytes)) << "nobody steers a clock so";
}

TEST(PulseRecord, AnUncertaintyIsWithinWhatItsFieldHolds) {
  Record bytes{};
  UtcPulse pulse = kPulse;
  pulse.apart = Duration{-1};
  EXPECT_EQ(write_pulse_record(pulse, bytes), kPulseRecordBytes);
  EXPECT_EQ(read_pulse_record(bytes).value().apart, Duration{0});
  pulse.apart = std::chrono::hours(1);
  EXPECT_EQ(write_pulse_record(pulse, bytes), kPulseRecordBytes);
  EXPECT_EQ(read_pulse_record(bytes).value().apart, Duration{std::numeric_limits<std::uint32_t>::max()});
}

TEST(PulseRecord, OtherMarksOtherEdgesACutAndWhatShouldBeZeroAreNoRecord) {
  for (const std::size_t at : {0U, 1U, 2U, 3U, 28U, 29U, 30U, 31U}) {
    Record bytes = kPulseBytes;
    bytes[at] = static_cast<std::uint8_t>(bytes[at] + 1);
    EXPECT_FALSE(read_pulse_record(bytes)) << at;
    bytes = kSteeringBytes;
    bytes[at] = static_cast<std::uint8_t>(bytes[at] + 1);
    EXPECT_FALSE(read_steering_record(bytes)) << at;
  }
  EXPECT_FALSE(read_pulse_record(std::span(kPulseBytes).first(kPulseRecordBytes - 1)));
  EXPECT_FALSE(read_steering_record(std::span(kSteeringBytes).first(kPulseRecordBytes - 1)));
}

TEST(PulseRecord, InstantsBeyondAllTimeAreDamage) {
  for (const std::int64_t sign : {1, -1}) {
    for (const std::int64_t beyond : {0, 1}) {
      const std::int64_t ns = sign * (kInstantMax_ns + beyond);
      const HostTime time = host_time_from_ns(ns);
      Record bytes{};
      EXPECT_EQ(write_pulse_record({PulseEdge::kAssert, 1, time, UtcTime{}, Duration{}}, bytes),
                kPulseRecordBytes);
      EXPECT_EQ(read_pulse_record(bytes).has_value(), beyond == 0) << ns;
      EXPECT_EQ(
          write_pulse_record({PulseEdge::kAssert, 1, HostTime{}, utc_time_from_ns(ns), Duration{}}, bytes),
          kPulseRecordBytes);
      EXPECT_EQ(read_pulse_record(bytes).has_value(), beyond == 0) << ns;
      EXPECT_EQ(write_steering_record({time, HostTime{}, 0.0, Duration{}}, bytes), kPulseRecordBytes);
      EXPECT_EQ(read_steering_record(bytes).has_value(), beyond == 0) << ns;
      EXPECT_EQ(write_steering_record({HostTime{}, time, 0.0, Duration{}}, bytes), kPulseRecordBytes);
      EXPECT_EQ(read_steering_record(bytes).has_value(), beyond == 0) << ns;
    }
  }
}

}  // namespace
}  // namespace imuscope
