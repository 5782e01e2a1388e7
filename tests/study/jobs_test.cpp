#include "study/jobs.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <numeric>

namespace imuscope {
namespace {

TEST(Jobs, EachIsDoneOnce) {
  constexpr std::size_t kJobs = 1000;
  std::array<std::atomic<int>, kJobs> done{};
  std::vector<Job> jobs;
  for (auto& one : done) jobs.emplace_back([&one] { ++one; });
  work_off(jobs);
  EXPECT_TRUE(std::ranges::all_of(done, [](const auto& times) { return times == 1; }));
  work_off({});
}

TEST(Jobs, TheFirstBeginFirst) {
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  std::vector<int> done;
  std::vector<Job> jobs;
  for (int i = 0; i < 20; ++i) jobs.emplace_back([&done, i] { done.push_back(i); });
  work_off(jobs);
  std::vector<int> in_order(20);
  std::iota(in_order.begin(), in_order.end(), 0);
  EXPECT_EQ(done, in_order);
}

}  // namespace
}  // namespace imuscope
