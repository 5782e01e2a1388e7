#include "service/lines/line_opener.h"

#include <gtest/gtest.h>
#include <atomic>
#include <chrono>
#include <future>
#include <thread>

namespace imuscope {
namespace {

LineOpener::Outcome failed(const char* why) { return work_error(why); }

std::optional<LineOpener::Outcome> wait_for(LineOpener& opener) {
  for (int i = 0; i < 5000; ++i) {
    if (auto outcome = opener.take()) return outcome;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return std::nullopt;
}

TEST(LineOpener, GivesTheOutcomeOnceAndThenBeginsAgain) {
  LineOpener opener;
  EXPECT_FALSE(opener.is_under_way());
  EXPECT_FALSE(opener.take());
  for (const char* why : {"first", "second"}) {
    opener.begin([why] { return failed(why); });
    const auto outcome = wait_for(opener);
    ASSERT_TRUE(outcome);
    ASSERT_FALSE(outcome->has_value());
    EXPECT_EQ(outcome->error().what, why);
    EXPECT_FALSE(opener.is_under_way());
    EXPECT_FALSE(opener.take());
  }
}

TEST(LineOpener, AnAttemptThatHangsHoldsNobody) {
  std::promise<void> answer;
  auto answered = std::make_shared<std::shared_future<void>>(answer.get_future());
  LineOpener opener;
  opener.begin([answered] {
    answered->wait();
    return failed("late");
  });
  EXPECT_TRUE(opener.is_under_way());
  EXPECT_FALSE(opener.take());
  answer.set_value();
  EXPECT_TRUE(wait_for(opener));
}

/// Counts those that are open.
class CountedLine final : public Transport {
 public:
  explicit CountedLine(std::shared_ptr<std::atomic<int>> open) : open_(std::move(open)) { ++*open_; }
  CountedLine(const CountedLine&) = delete;
  CountedLine& operator=(const CountedLine&) = delete;
  ~CountedLine() override { --*open_; }
  IoResult read(std::span<std::uint8_t>) noexcept override { return {}; }
  IoResult write(std::span<const std::uint8_t>) noexcept override { return {}; }
  int fd() const noexcept override { return -1; }
  std::string describe() const override { return "counted"; }

 private:
  std::shared_ptr<std::atomic<int>> open_;
};

TEST(LineOpener, WhatIsOpenedAfterItsEndIsClosed) {
  const auto open = std::make_shared<std::atomic<int>>(0);
  const auto ended = std::make_shared<std::atomic<bool>>(false);
  const auto opened = std::make_shared<std::atomic<bool>>(false);
  {
    LineOpener opener;
    opener.begin([=]() -> LineOpener::Outcome {
      while (!*ended) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      auto line = std::make_unique<CountedLine>(open);
      *opened = true;
      return line;
    });
  }
  *ended = true;
  for (int i = 0; i < 5000 && (!*opened || *open > 0); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  EXPECT_TRUE(*opened);
  EXPECT_EQ(*open, 0);
}

}  // namespace
}  // namespace imuscope
