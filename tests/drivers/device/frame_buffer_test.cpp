#include "drivers/device/frame_buffer.h"

#include <gtest/gtest.h>

#include <vector>

namespace imuscope {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr HostTime kRead{milliseconds{1000}};
constexpr Duration kByte = microseconds{100};

TEST(FrameBuffer, EachByteOfABurstIsDatedBackByTheBytesThatFollowedItOnTheWire) {
  FrameBuffer<256> buffer(kByte);
  const std::vector<std::uint8_t> burst(62);
  EXPECT_EQ(buffer.append(burst, kRead), 62U);
  EXPECT_EQ(buffer.arrival_of(0), kRead - 62 * kByte);
  EXPECT_EQ(buffer.arrival_of(31), kRead - 31 * kByte);
  EXPECT_EQ(buffer.arrival_of(61), kRead - kByte);
}

TEST(FrameBuffer, AFrameThatSpansReadsIsDatedByTheReadOfItsFirstByte) {
  FrameBuffer<256> buffer(kByte);
  buffer.append(std::vector<std::uint8_t>(10), kRead);
  buffer.append(std::vector<std::uint8_t>(20), kRead + milliseconds{16});
  EXPECT_EQ(buffer.arrival_of(8), kRead - 2 * kByte);
  EXPECT_EQ(buffer.arrival_of(10), kRead + milliseconds{16} - 20 * kByte);
  buffer.consume(9);
  EXPECT_EQ(buffer.arrival_of(0), kRead - kByte);
  EXPECT_EQ(buffer.arrival_of(1), kRead + milliseconds{16} - 20 * kByte);
}

TEST(FrameBuffer, AReadThatDoesNotFitAtOnceIsStillOneRead) {
  FrameBuffer<64> buffer(kByte);
  const std::vector<std::uint8_t> burst(100);
  std::span<const std::uint8_t> rest(burst);
  rest = rest.subspan(buffer.append(rest, kRead));
  EXPECT_EQ(buffer.arrival_of(0), kRead - 100 * kByte);
  buffer.consume(60);
  rest = rest.subspan(buffer.append(rest, kRead));
  EXPECT_TRUE(rest.empty());
  EXPECT_EQ(buffer.arrival_of(0), kRead - 40 * kByte);
  EXPECT_EQ(buffer.position(), 60U);
}

TEST(FrameBuffer, MoreReadsThanItRemembersMakeStampsLaterNeverEarlier) {
  FrameBuffer<1024> buffer(kByte);
  constexpr int kReads = 200;
  for (int i = 0; i < kReads; ++i) {
    buffer.append(std::vector<std::uint8_t>(1), kRead + i * milliseconds{1});
  }
  for (std::size_t i = 0; i < kReads; ++i) {
    const HostTime real = kRead + static_cast<int>(i) * milliseconds{1} - kByte;
    EXPECT_GE(buffer.arrival_of(i), real) << i;
  }
  EXPECT_EQ(buffer.arrival_of(10), kRead + milliseconds{10} - kByte);
}

}  // namespace
}  // namespace imuscope
