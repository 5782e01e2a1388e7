#include "rt/spsc_ring.h"

#include <gtest/gtest.h>
#include <deque>
#include <memory>
#include <random>
#include <thread>

namespace imuscope {
namespace {

TEST(SpscRing, GivesBackWhatWasPushedInOrder) {
  SpscRing<int, 4> ring;
  EXPECT_TRUE(ring.try_push(1));
  EXPECT_TRUE(ring.try_push(2));
  int value = 0;
  ASSERT_TRUE(ring.try_pop(value));
  EXPECT_EQ(value, 1);
  ASSERT_TRUE(ring.try_pop(value));
  EXPECT_EQ(value, 2);
  EXPECT_FALSE(ring.try_pop(value));
}

TEST(SpscRing, UsesEverySlotThenRefusesTheNewestAndCountsIt) {
  SpscRing<int, 4> ring;
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(ring.try_push(i)) << i;
  EXPECT_FALSE(ring.try_push(4));
  EXPECT_FALSE(ring.try_push(5));
  EXPECT_EQ(ring.counters().refused, 2U);
  EXPECT_EQ(ring.counters().pushed, 4U);
  EXPECT_EQ(ring.counters().level, 4U);
  ASSERT_NE(ring.front(), nullptr);
  EXPECT_EQ(*ring.front(), 0) << "an accepted element was overwritten";
  ring.pop();
  EXPECT_TRUE(ring.try_push(6)) << "one free slot must take one element";
}

TEST(SpscRing, FrontStaysUntilPop) {
  SpscRing<int, 2> ring;
  ASSERT_TRUE(ring.try_push(7));
  EXPECT_EQ(ring.front(), ring.front());
  EXPECT_EQ(*ring.front(), 7);
  ring.pop();
  EXPECT_EQ(ring.front(), nullptr);
}

TEST(SpscRing, PopOnAnEmptyRingIsAProgrammingError) {
  SpscRing<int, 2> ring;
  EXPECT_DEATH(ring.pop(), "precondition");
}

TEST(SpscRing, CapacityOneWorks) {
  SpscRing<int, 1> ring;
  int value = 0;
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(ring.try_push(i));
    EXPECT_FALSE(ring.try_push(-1));
    ASSERT_TRUE(ring.try_pop(value));
    EXPECT_EQ(value, i);
  }
  EXPECT_EQ(ring.counters().refused, 5U);
}

/// Random pushes and pops against std::deque, which cannot be wrong about order, level, refusals or marks.
TEST(SpscRing, BehavesAsABoundedDequeInAHundredThousandRandomSteps) {
  constexpr std::size_t kCapacity = 8;
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    SpscRing<std::uint32_t, kCapacity> ring;
    std::deque<std::uint32_t> model;
    std::uint64_t refused = 0;
    std::uint64_t high_water = 0;
    std::mt19937 random(seed);
    for (std::uint32_t step = 0; step < 100'000; ++step) {
      // Phases in which pushing or popping prevails, so that both full and empty are visited.
      const bool push = random() % 100 < ((step / 64) % 2 == 0 ? 60U : 40U);
      if (push) {
        const bool taken = ring.try_push(step);
        ASSERT_EQ(taken, model.size() < kCapacity) << "seed " << seed << " step " << step;
        if (taken) model.push_back(step);
        refused += taken ? 0 : 1;
        high_water = std::max<std::uint64_t>(high_water, model.size());
      } else {
        std::uint32_t value = 0;
        const bool got = ring.try_pop(value);
        ASSERT_EQ(got, !model.empty()) << "seed " << seed << " step " << step;
        if (got) {
          ASSERT_EQ(value, model.front()) << "seed " << seed << " step " << step;
          model.pop_front();
        }
      }
      const RingCounters counters = ring.counters();
      ASSERT_EQ(counters.level, model.size());
      ASSERT_EQ(counters.refused, refused);
      ASSERT_EQ(counters.high_water, high_water);
    }
    EXPECT_EQ(high_water, kCapacity) << "the walk never filled the ring: the test is too tame";
    EXPECT_GT(refused, 0U);
  }
}

/// An element that shows whether it was torn: every word is derived from the first.
struct Element {
  std::uint64_t number;
  std::array<std::uint64_t, 15> derived;
};
Element make_element(std::uint64_t number) {
  Element element{number, {}};
  for (std::size_t i = 0; i < element.derived.size(); ++i) element.derived[i] = number * (i + 3);
  return element;
}
bool is_whole(const Element& element) {
  for (std::size_t i = 0; i < element.derived.size(); ++i) {
    if (element.derived[i] != element.number * (i + 3)) return false;
  }
  return true;
}

TEST(SpscRingStress, ProducerOutrunsConsumerAndEveryLossIsCounted) {
  constexpr std::uint64_t kCount = 400'000;
  const auto ring = std::make_unique<SpscRing<Element, 64>>();
  std::uint64_t accepted = 0;
  std::atomic<bool> done{false};
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kCount; ++i) {
      if (ring->try_push(make_element(i))) accepted += 1;
      if (i % 1024 == 0) std::this_thread::yield();
    }
    done.store(true);
  });
  std::uint64_t received = 0;
  std::uint64_t torn = 0;
  std::uint64_t out_of_order = 0;
  std::uint64_t next = 0;
  Element element{};
  for (bool last = false;;) {
    if (!ring->try_pop(element)) {
      if (last) break;
      last = done.load();
      continue;
    }
    received += 1;
    torn += is_whole(element) ? 0 : 1;
    out_of_order += element.number >= next ? 0 : 1;
    next = element.number + 1;
  }
  producer.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(out_of_order, 0U);
  EXPECT_EQ(received, accepted);
  EXPECT_EQ(ring->counters().refused, kCount - accepted);
  EXPECT_LE(ring->counters().high_water, 64U);
}

TEST(SpscRingStress, APatientProducerLosesNothing) {
  constexpr std::uint64_t kCount = 400'000;
  const auto ring = std::make_unique<SpscRing<Element, 16>>();
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kCount; ++i) {
      while (!ring->try_push(make_element(i))) std::this_thread::yield();
    }
  });
  std::uint64_t wrong = 0;
  Element element{};
  for (std::uint64_t i = 0; i < kCount; ++i) {
    while (!ring->try_pop(element)) std::this_thread::yield();
    wrong += element.number == i && is_whole(element) ? 0 : 1;
  }
  producer.join();
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(ring->front(), nullptr);
}

TEST(SpscRingStress, CountersSeenByAThirdThreadAreAlwaysPossible) {
  const auto ring = std::make_unique<SpscRing<std::uint64_t, 8>>();
  std::atomic<bool> stop{false};
  std::thread producer([&] {
    for (std::uint64_t i = 0; !stop.load(std::memory_order_relaxed); ++i) {
      if (!ring->try_push(i)) std::this_thread::yield();
    }
  });
  std::thread consumer([&] {
    std::uint64_t value = 0;
    while (!stop.load(std::memory_order_relaxed)) {
      if (!ring->try_pop(value)) std::this_thread::yield();
    }
  });
  RingCounters before{};
  std::uint64_t impossible = 0;
  for (int i = 0; i < 20'000; ++i) {
    const RingCounters now = ring->counters();
    const bool grows =
        now.pushed >= before.pushed && now.refused >= before.refused && now.high_water >= before.high_water;
    impossible += grows && now.level <= 8 && now.high_water <= 8 ? 0 : 1;
    before = now;
  }
  stop.store(true);
  producer.join();
  consumer.join();
  EXPECT_EQ(impossible, 0U);
}

}  // namespace
}  // namespace imuscope
