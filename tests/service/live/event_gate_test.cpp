#include "service/live/event_gate.h"

#include <gtest/gtest.h>

namespace imuscope {
namespace {

constexpr HostTime kGateBegin{std::chrono::hours(1)};
constexpr std::size_t kShort = 100;

TEST(EventGate, TakesWhatAPersonMarks) {
  EventGate gate;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_TRUE(gate.take(kShort, kGateBegin + i * std::chrono::milliseconds(500))) << i;
  }
  EXPECT_EQ(gate.due_report(kGateBegin + std::chrono::hours(1)), 0U);
}

TEST(EventGate, OfAFloodItTakesItsRateAndTellsOfTheRestNowAndThen) {
  EventGate gate;
  int taken = 0;
  int reports = 0;
  std::uint64_t refused = 0;
  constexpr int kPerSecond = 10'000;
  constexpr int kSeconds = 100;
  for (int i = 0; i < kSeconds * kPerSecond; ++i) {
    const HostTime now = kGateBegin + i * std::chrono::microseconds(1'000'000 / kPerSecond);
    taken += gate.take(kShort, now) ? 1 : 0;
    if (const auto told = gate.due_report(now)) {
      ++reports;
      refused += told;
    }
  }
  refused += gate.due_report(kGateBegin + std::chrono::hours(1));
  EXPECT_NEAR(taken, EventGate::kEventsAtOnce + kSeconds * EventGate::kEventsPerSecond, 1);
  EXPECT_EQ(reports, 4) << "at once and after 30, 60 and 90 s";
  EXPECT_EQ(refused + static_cast<std::uint64_t>(taken), std::uint64_t{kSeconds} * kPerSecond);
}

TEST(EventGate, RefusesWhatIsLongerThanAnEvent) {
  EventGate gate;
  EXPECT_TRUE(gate.take(EventGate::kLongestEventBytes, kGateBegin));
  EXPECT_FALSE(gate.take(EventGate::kLongestEventBytes + 1, kGateBegin));
  EXPECT_EQ(gate.due_report(kGateBegin), 1U);
}

}  // namespace
}  // namespace imuscope
