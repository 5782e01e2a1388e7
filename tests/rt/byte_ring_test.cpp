#include "rt/byte_ring.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <random>
#include <thread>

namespace imuscope {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes bytes_of(std::span<const std::uint8_t> span) { return {span.begin(), span.end()}; }

/// Every byte follows from the number and the length, so that a torn record shows.
Bytes pattern(std::uint64_t number, std::size_t length) {
  Bytes bytes(length);
  for (std::size_t i = 0; i < length; ++i)
    bytes[i] = static_cast<std::uint8_t>(number * 31 + i * 7 + (number >> 8U));
  return bytes;
}

TEST(ByteRing, GivesBackWholeRecordsInOrder) {
  ByteRing ring(64);
  EXPECT_TRUE(ring.front().empty());
  EXPECT_TRUE(ring.try_push(Bytes{1}, Bytes{2, 3}));
  EXPECT_TRUE(ring.try_push(Bytes{4}, {}));
  EXPECT_EQ(bytes_of(ring.front()), (Bytes{1, 2, 3}));
  EXPECT_EQ(bytes_of(ring.front()), (Bytes{1, 2, 3})) << "it stays until pop()";
  ring.pop();
  EXPECT_EQ(bytes_of(ring.front()), (Bytes{4}));
  ring.pop();
  EXPECT_TRUE(ring.front().empty());
}

TEST(ByteRing, AShortRecordTakesLittleRoom) {
  ByteRing ring(1024);
  int taken = 0;
  while (ring.try_push(Bytes(8), {})) ++taken;
  EXPECT_EQ(taken, 1024 / 16) << "eight bytes, and eight for their length";
  EXPECT_EQ(ring.counters().refused, 1U);
  EXPECT_EQ(ring.counters().level, 1024U);
  EXPECT_EQ(ring.counters().high_water, 1024U);
}

TEST(ByteRing, ARecordThatIsLongerThanTheRingIsRefused) {
  ByteRing ring(64);
  EXPECT_FALSE(ring.try_push(Bytes(57), {}));
  EXPECT_TRUE(ring.try_push(Bytes(56), {}));
  EXPECT_EQ(ring.counters().refused, 1U);
}

TEST(ByteRing, PopOnAnEmptyRingIsAProgrammingError) {
  ByteRing ring(64);
  EXPECT_DEATH(ring.pop(), "precondition");
}

/// Against a deque: what is taken comes out whole and in order, and what is refused would not have fitted.
TEST(ByteRing, BehavesAsADequeOfRecordsInAHundredThousandRandomSteps) {
  constexpr std::size_t kCapacity = 256;
  ByteRing ring(kCapacity);
  std::deque<Bytes> model;
  std::uint64_t refused = 0;
  std::uint64_t pushed = 0;
  std::uint64_t refused_empty = 0;
  std::mt19937 random(1);
  const auto room = [](std::size_t length) { return 8 + (length + 7) / 8 * 8; };
  for (std::uint32_t step = 0; step < 100'000; ++step) {
    if (random() % 100 < ((step / 64) % 2 == 0 ? 60U : 40U)) {
      const Bytes record = pattern(step, 1 + random() % 100);
      const std::size_t cut = random() % (record.size() + 1);
      const std::span<const std::uint8_t> all(record);
      std::size_t level = 0;
      for (const auto& waiting : model) level += room(waiting.size());
      const bool taken = ring.try_push(all.first(cut), all.subspan(cut));
      if (taken) {
        ASSERT_LE(level + room(record.size()), kCapacity) << "step " << step;
        model.push_back(record);
        ++pushed;
      } else {
        // What is passed over at the end is shorter than the record that did not fit there.
        ASSERT_GT(ring.counters().level + 2 * room(record.size()), kCapacity) << "step " << step;
        refused_empty += model.empty() ? 1 : 0;
        ++refused;
      }
    } else if (const auto front = ring.front(); front.empty()) {
      ASSERT_TRUE(model.empty()) << "step " << step;
    } else {
      ASSERT_EQ(bytes_of(front), model.front()) << "step " << step;
      ring.pop();
      model.pop_front();
    }
    ASSERT_EQ(ring.counters().refused, refused);
    ASSERT_EQ(ring.counters().pushed, pushed);
    ASSERT_LE(ring.counters().level, kCapacity);
  }
  EXPECT_EQ(refused_empty, 0U);
  EXPECT_GT(refused, 1000U) << "the walk hardly filled the ring: the test is too tame";
  EXPECT_GT(ring.counters().high_water, kCapacity * 9 / 10);
}

TEST(ByteRingStress, ProducerOutrunsConsumerAndEveryLossIsCounted) {
  constexpr std::uint64_t kCount = 400'000;
  ByteRing ring(1024);
  std::atomic<bool> done{false};
  std::uint64_t accepted = 0;
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kCount; ++i) {
      Bytes head(8);
      for (std::size_t k = 0; k < 8; ++k) head[k] = static_cast<std::uint8_t>(i >> (8 * k));
      accepted += ring.try_push(head, pattern(i, i * 2654435761U % 120)) ? 1 : 0;
      if (i % 1024 == 0) std::this_thread::yield();
    }
    done.store(true);
  });
  std::uint64_t received = 0;
  std::uint64_t torn = 0;
  std::uint64_t out_of_order = 0;
  std::uint64_t next = 0;
  for (bool last = false;;) {
    const auto record = ring.front();
    if (record.empty()) {
      if (last) break;
      last = done.load();
      continue;
    }
    std::uint64_t number = 0;
    for (std::size_t k = 0; k < 8; ++k) number |= static_cast<std::uint64_t>(record[k]) << (8 * k);
    const Bytes expected = pattern(number, number * 2654435761U % 120);
    torn += std::ranges::equal(record.subspan(8), expected) ? 0 : 1;
    out_of_order += number >= next ? 0 : 1;
    next = number + 1;
    ++received;
    ring.pop();
  }
  producer.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(out_of_order, 0U);
  EXPECT_EQ(received, accepted);
  EXPECT_EQ(ring.counters().refused, kCount - accepted);
  EXPECT_EQ(ring.counters().level, 0U);
}

}  // namespace
}  // namespace imuscope
