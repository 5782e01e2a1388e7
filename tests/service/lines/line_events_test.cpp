#include "service/lines/line_events.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <array>
#include <cerrno>

#include "rt/host_clock.h"
#include "tests/support/refused_calls.h"

namespace imuscope {
namespace {

using std::chrono::milliseconds;
using test::Call;
using test::RefusedCalls;

/// A line whose far end is in the test's hand.
class Line {
 public:
  explicit Line(int epoll) {
    EXPECT_EQ(pipe(ends_.data()), 0);
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.ptr = this;
    EXPECT_EQ(epoll_ctl(epoll, EPOLL_CTL_ADD, ends_[0], &event), 0);
  }
  ~Line() {
    for (const int end : ends_) close(end);
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;
  void send() const { EXPECT_EQ(write(ends_[1], "x", 1), 1); }

 private:
  std::array<int, 2> ends_{};
};

/// Waits out a time, gives a line's event before it, and waits it out again.
void expect_waits(LineEvents& waiter) {
  const Line line(waiter.epoll());
  std::array<epoll_event, 4> events{};
  for (int i = 0; i < 3; ++i) {
    const HostTime until = host_now() + milliseconds(5);
    EXPECT_EQ(waiter.wait(events, until), 0);
    EXPECT_GE(host_now(), until);
  }
  line.send();
  const HostTime begin = host_now();
  ASSERT_EQ(waiter.wait(events, begin + std::chrono::seconds(100)), 1);
  const void* const which = events[0].data.ptr;  // the event is packed: nothing may refer into it
  EXPECT_EQ(which, &line);
  EXPECT_LT(host_now(), begin + std::chrono::seconds(100));
  EXPECT_EQ(waiter.wait(events, begin), 1) << "also when the time has passed";
}

TEST(LineEvents, WaitsForALineOrATime) {
  LineEvents waiter;
  ASSERT_TRUE(waiter.open());
  expect_waits(waiter);
}

TEST(LineEvents, WithoutTheKernelsPreciseWaitATimerServes) {
  for (const int error : {ENOSYS, EPERM}) {
    const RefusedCalls refused(Call::kEpollPwait2, error, 1'000'000);
    LineEvents waiter;
    ASSERT_TRUE(waiter.open());
    expect_waits(waiter);
    EXPECT_EQ(refused.left(), 1'000'000 - 1) << "it is asked for once";
  }
}

TEST(LineEvents, AnErrorOfTheWaitIsNoTurnWithoutWaiting) {
  LineEvents waiter;
  ASSERT_TRUE(waiter.open());
  const RefusedCalls refused(Call::kEpollPwait2, EPERM, 1'000'000);
  std::array<epoll_event, 4> events{};
  const HostTime until = host_now() + milliseconds(20);
  EXPECT_EQ(waiter.wait(events, until), 0);
  EXPECT_GE(host_now(), until);
  EXPECT_EQ(refused.left(), 1'000'000 - 1);
}

}  // namespace
}  // namespace imuscope
