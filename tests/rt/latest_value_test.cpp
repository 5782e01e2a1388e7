#include "rt/latest_value.h"

#include <gtest/gtest.h>
#include <memory>
#include <optional>
#include <random>
#include <thread>

namespace imuscope {
namespace {

TEST(LatestValue, HoldsTheDefaultUntilSomethingIsWritten) {
  LatestValue<int> cell;
  EXPECT_FALSE(cell.take());
  EXPECT_EQ(cell.value(), 0);
}

TEST(LatestValue, GivesTheNewestAndEachOnlyOnce) {
  LatestValue<int> cell;
  cell.write(1);
  cell.write(2);
  cell.write(3);
  ASSERT_TRUE(cell.take());
  EXPECT_EQ(cell.value(), 3);
  EXPECT_FALSE(cell.take());
  EXPECT_EQ(cell.value(), 3) << "the value taken must stay until the next take";
}

TEST(LatestValue, TheValueTakenIsNotDisturbedByLaterWrites) {
  LatestValue<int> cell;
  cell.write(1);
  ASSERT_TRUE(cell.take());
  for (int i = 2; i < 10; ++i) cell.write(i);
  EXPECT_EQ(cell.value(), 1);
  ASSERT_TRUE(cell.take());
  EXPECT_EQ(cell.value(), 9);
}

TEST(LatestValue, BehavesAsAnOptionalThatIsOverwrittenInRandomSteps) {
  LatestValue<std::uint32_t> cell;
  std::optional<std::uint32_t> pending;
  std::uint32_t taken = 0;
  std::mt19937 random(5);
  for (std::uint32_t step = 1; step < 100'000; ++step) {
    if (random() % 2 == 0) {
      cell.write(step);
      pending = step;
    } else {
      ASSERT_EQ(cell.take(), pending.has_value());
      taken = pending.value_or(taken);
      pending.reset();
    }
    ASSERT_EQ(cell.value(), taken);
  }
}

struct Wide {
  std::array<std::uint64_t, 32> words;
};

TEST(LatestValueStress, ValuesAreNeverTornAndNeverGoBack) {
  constexpr std::uint64_t kCount = 500'000;
  const auto cell = std::make_unique<LatestValue<Wide>>();
  std::thread writer([&] {
    Wide wide{};
    for (std::uint64_t i = 1; i <= kCount; ++i) {
      wide.words.fill(i);
      cell->write(wide);
    }
  });
  std::uint64_t last = 0;
  std::uint64_t wrong = 0;
  while (last < kCount) {
    if (!cell->take()) continue;
    const Wide& wide = cell->value();
    for (const std::uint64_t word : wide.words) wrong += word == wide.words[0] ? 0 : 1;
    wrong += wide.words[0] > last ? 0 : 1;
    last = wide.words[0];
  }
  writer.join();
  EXPECT_EQ(wrong, 0U);
}

}  // namespace
}  // namespace imuscope
