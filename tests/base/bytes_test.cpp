#include "base/bytes.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <vector>

namespace imuscope {
namespace {

TEST(Bytes, NumbersAreReadInBothOrdersAtAnyOffset) {
  const std::vector<std::uint8_t> bytes{0xEE, 0x01, 0x02, 0x03, 0x84, 0x05, 0x06, 0x07, 0x88};
  EXPECT_EQ(read_be<std::uint8_t>(bytes, 1), 0x01);
  EXPECT_EQ(read_be<std::uint16_t>(bytes, 1), 0x0102);
  EXPECT_EQ(read_be<std::uint32_t>(bytes, 1), 0x01020384U);
  EXPECT_EQ(read_be<std::uint64_t>(bytes, 1), 0x0102038405060788ULL);
  EXPECT_EQ(read_le<std::uint16_t>(bytes, 1), 0x0201);
  EXPECT_EQ(read_le<std::uint32_t>(bytes, 1), 0x84030201U);
  EXPECT_EQ(read_le<std::int32_t>(bytes, 1), static_cast<std::int32_t>(0x84030201U));
  EXPECT_EQ(read_le<std::int64_t>(bytes, 1), static_cast<std::int64_t>(0x8807060584030201ULL));
  const std::vector<std::uint8_t> one{0x3F, 0x80, 0x00, 0x00};
  EXPECT_EQ(read_be<float>(one), 1.0F);
}

TEST(Bytes, TheSumOfBytesIsThatOfAddingThemOneByOne) {
  std::mt19937 random(9);
  for (std::size_t size = 0; size < 3000; size = size < 40 ? size + 1 : size + 97) {
    std::vector<std::uint8_t> bytes(size);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    EXPECT_EQ(sum_of_bytes(bytes), std::accumulate(bytes.begin(), bytes.end(), 0U)) << size;
    std::fill(bytes.begin(), bytes.end(), std::uint8_t{255});
    EXPECT_EQ(sum_of_bytes(bytes), 255 * size);
  }
}

}  // namespace
}  // namespace imuscope
