#include "drivers/device/can_frame.h"

#include <gtest/gtest.h>
#include <linux/can.h>

#include <cstring>
#include <random>
#include <vector>

namespace imuscope {
namespace {

CanFrame example(std::uint8_t length, bool fd) {
  CanFrame frame;
  frame.id = 0x123;
  frame.is_fd = fd;
  frame.length = length;
  frame.stamp = host_time_from_ns(1'772'000'000'123'456'789);
  for (std::uint8_t i = 0; i < length; ++i) frame.data[i] = static_cast<std::uint8_t>(3 * i + 1);
  return frame;
}

std::vector<std::uint8_t> record_of(const CanFrame& frame) {
  std::vector<std::uint8_t> bytes(kCanRecordMaxBytes);
  bytes.resize(write_can_record(frame, bytes));
  return bytes;
}

void expect_same(const CanFrame& a, const CanFrame& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.is_extended, b.is_extended);
  EXPECT_EQ(a.is_remote, b.is_remote);
  EXPECT_EQ(a.is_error, b.is_error);
  EXPECT_EQ(a.is_fd, b.is_fd);
  EXPECT_EQ(a.bit_rate_switched, b.bit_rate_switched);
  EXPECT_EQ(a.sender_error_state, b.sender_error_state);
  EXPECT_EQ(a.length, b.length);
  EXPECT_EQ(a.raw_dlc, b.raw_dlc);
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_EQ(a.data, b.data);
}

TEST(CanFrame, EveryKindComesBackFromItsRecordAsItWas) {
  std::vector<CanFrame> frames;
  for (std::uint8_t n = 0; n <= 8; ++n) frames.push_back(example(n, false));
  for (const int n : {0, 8, 12, 16, 20, 24, 32, 48, 64})
    frames.push_back(example(static_cast<std::uint8_t>(n), true));
  frames.back().bit_rate_switched = true;
  frames.back().sender_error_state = true;
  frames.push_back(example(4, false));
  frames.back().is_extended = true;
  frames.back().id = kCanExtendedIdMax;
  frames.push_back(example(0, false));
  frames.back().is_remote = true;
  frames.back().length = 5;
  frames.push_back(example(8, false));
  frames.back().is_error = true;
  frames.back().id = 0x204;
  frames.push_back(example(8, false));
  frames.back().raw_dlc = 11;

  std::vector<std::uint8_t> read;
  for (const auto& frame : frames) {
    const auto record = record_of(frame);
    read.insert(read.end(), record.begin(), record.end());
  }
  CanFrameReader reader(read);
  CanFrame frame;
  for (const auto& expected : frames) {
    ASSERT_TRUE(reader.next(frame));
    expect_same(frame, expected);
  }
  EXPECT_FALSE(reader.next(frame));
  EXPECT_EQ(reader.bytes_skipped(), 0U);
}

TEST(CanFrame, RecordBeginsLikeTheKernelsFrame) {
  auto frame = example(12, true);
  frame.is_extended = true;
  frame.id = 0x18FF0100;
  frame.bit_rate_switched = true;
  const auto record = record_of(frame);
  canfd_frame kernel{};
  std::memcpy(&kernel, record.data(), offsetof(canfd_frame, data));
  EXPECT_EQ(kernel.can_id, 0x18FF0100U | CAN_EFF_FLAG);
  EXPECT_EQ(kernel.len, 12);
  EXPECT_EQ(kernel.flags, CANFD_BRS | 0x04);  // CANFD_FDF, which older headers lack
  EXPECT_EQ(std::memcmp(record.data() + kCanRecordHeaderBytes, frame.data.data(), 12), 0);
}

TEST(CanFrame, RecordThatIsCutOffIsSkippedAndCounted) {
  const auto whole = record_of(example(8, false));
  for (std::size_t n = 1; n < whole.size(); ++n) {
    auto bytes = whole;
    bytes.insert(bytes.end(), whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n));
    CanFrameReader reader(bytes);
    CanFrame frame;
    EXPECT_TRUE(reader.next(frame));
    EXPECT_FALSE(reader.next(frame)) << n;
    EXPECT_EQ(reader.bytes_skipped(), n);
    EXPECT_FALSE(reader.next(frame));
    EXPECT_EQ(reader.bytes_skipped(), n);
  }
}

TEST(CanFrame, ImpossibleRecordsAreRefused) {
  const auto good = record_of(example(8, false));
  const auto refused = [&](std::size_t at, std::uint8_t value) {
    auto bytes = good;
    bytes[at] = value;
    CanFrame frame;
    return !CanFrameReader(bytes).next(frame);
  };
  EXPECT_FALSE(refused(4, 8));
  EXPECT_TRUE(refused(4, 9)) << "nine bytes in a classic frame";
  EXPECT_TRUE(refused(4, 255));
  EXPECT_TRUE(refused(1, 0x09)) << "an 11-bit identifier above 7FF";
  EXPECT_TRUE(refused(5, 0x08)) << "a flag that does not exist";
  EXPECT_TRUE(refused(7, 1));
}

TEST(CanFrame, NothingIsReadBeyondTheEndOfDamagedBytes) {
  std::mt19937 random(1);
  for (int i = 0; i < 20'000; ++i) {
    std::vector<std::uint8_t> bytes(random() % 200);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random() % 4 == 0 ? random() : 0);
    CanFrameReader reader(bytes);
    CanFrame frame;
    std::size_t used = 0;
    while (reader.next(frame)) {
      EXPECT_TRUE(is_can_length(frame.length, frame.is_fd));
      used += kCanRecordHeaderBytes + frame.payload().size();
    }
    EXPECT_EQ(used + reader.bytes_skipped(), bytes.size());
  }
}

TEST(CanFrame, LengthsAreThoseOfTheStandard) {
  for (const std::size_t n : {9, 10, 11, 13, 63, 65}) EXPECT_FALSE(is_can_length(n, true)) << n;
  EXPECT_TRUE(is_can_length(64, true));
  EXPECT_FALSE(is_can_length(12, false));
}

}  // namespace
}  // namespace imuscope
