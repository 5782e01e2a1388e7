#include "service/recording/sink_beside.h"

#include <gtest/gtest.h>
#include <chrono>
#include <string>
#include <thread>

namespace imuscope {
namespace {

/// Writes down what it is told, and by which thread.
class Notes final : public CoreSink {
 public:
  void on_epoch(const SImuEpoch& epoch, const TickFacts& facts) noexcept override {
    note("epoch " + std::to_string(epoch.study) + " of " +
         std::to_string(facts.first_reference_time.time_since_epoch().count()));
  }
  void on_error(const ErrorRecord& record) noexcept override {
    note("error " + std::to_string(record.study));
  }
  void on_event(const EstimatorEvent& event) noexcept override {
    note("event " + std::to_string(event.time.time_since_epoch().count()));
  }
  void on_snapshot(const Snapshot& snapshot) noexcept override {
    note("snapshot " + std::to_string(snapshot.tick));
  }
  void on_late_sample(const LateSample& late) noexcept override {
    note("late " + std::to_string(late.sequence));
  }
  void on_noise_applied(const AppliedNoise& applied) noexcept override {
    note("noise " + std::to_string(applied.tick));
  }

  std::chrono::milliseconds first_pause{0};
  std::vector<std::string> all;
  std::vector<std::thread::id> threads;

 private:
  void note(std::string what) {
    if (all.empty()) std::this_thread::sleep_for(first_pause);
    all.push_back(std::move(what));
    if (threads.empty() || threads.back() != std::this_thread::get_id())
      threads.push_back(std::this_thread::get_id());
  }
};

/// A drive's worth of everything, in no regular order.
void tell(CoreSink& sink, int n) {
  for (int i = 0; i < n; ++i) {
    if (i % 7 != 3) {
      SImuEpoch epoch{};
      epoch.study = static_cast<std::size_t>(i % 3);
      TickFacts facts{};
      facts.first_reference_time = HostTime{Duration{i}};
      sink.on_epoch(epoch, facts);
    }
    if (i % 5 == 0) {
      ErrorRecord record{};
      record.study = static_cast<std::size_t>(i);
      sink.on_error(record);
    }
    if (i % 11 == 0) {
      Snapshot snapshot{};
      snapshot.tick = i;
      sink.on_snapshot(snapshot);
    }
    if (i % 101 == 0) {
      EstimatorEvent event{};
      event.time = HostTime{Duration{i}};
      sink.on_event(event);
      sink.on_late_sample({0, static_cast<std::uint64_t>(i), i});
      AppliedNoise applied{};
      applied.tick = i;
      sink.on_noise_applied(applied);
    }
  }
}

TEST(SinkBeside, TellsAllInTheOrderInWhichItCameFromOneOtherThread) {
  for (const int n : {0, 1, 10, 20'000}) {
    Notes direct;
    tell(direct, n);
    Notes notes;
    {
      SinkBeside beside(notes);
      tell(beside, n);
    }
    EXPECT_EQ(notes.all, direct.all) << n;
    if (n == 0) continue;
    ASSERT_EQ(notes.threads.size(), 1U) << n;
    EXPECT_NE(notes.threads.front(), std::this_thread::get_id());
  }
}

// All blocks there can be are full before the first is worked off, and none is asked back after.
TEST(SinkBeside, EndsWhereItsThreadBeganLate) {
  for (const int n : {500, 2'000, 5'000}) {
    Notes direct;
    tell(direct, n);
    Notes notes;
    notes.first_pause = std::chrono::milliseconds(50);
    {
      SinkBeside beside(notes);
      tell(beside, n);
    }
    EXPECT_EQ(notes.all, direct.all) << n;
  }
}

}  // namespace
}  // namespace imuscope
