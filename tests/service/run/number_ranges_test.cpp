#include "service/run/number_ranges.h"

#include <gtest/gtest.h>
#include <random>
#include <set>

namespace imuscope {
namespace {

TEST(NumberRanges, HoldWhatASetOfEveryNumberHolds) {
  std::mt19937 random(11);
  for (int repetition = 0; repetition < 200; ++repetition) {
    NumberRanges ranges;
    std::set<std::int64_t> numbers;
    for (int k = 0; k < 12; ++k) {
      const auto first = static_cast<std::int64_t>(random() % 100);
      const auto count = static_cast<std::int64_t>(random() % 12);
      ranges.add(first, count);
      for (std::int64_t i = 0; i < count; ++i) numbers.insert(first + i);
    }
    for (std::int64_t number = -2; number < 115; ++number)
      ASSERT_EQ(ranges.contains(number), numbers.contains(number)) << number;
  }
}

TEST(NumberRanges, TakeARowOfAnyLengthAtOnce) {
  NumberRanges ranges;
  constexpr std::int64_t kMany = std::int64_t{1} << 61U;
  ranges.add(5, kMany);
  EXPECT_FALSE(ranges.contains(4));
  EXPECT_TRUE(ranges.contains(kMany));
  EXPECT_FALSE(ranges.contains(kMany + 5));
}

}  // namespace
}  // namespace imuscope
