#include "service/lines/line_events.h"

#include <sys/timerfd.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>

#include "rt/host_clock.h"
#include "rt/periodic.h"

namespace imuscope {

namespace {

timespec timespec_of(std::int64_t ns) noexcept {
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  return {ns / kNsPerSecond, ns % kNsPerSecond};
}

tl::unexpected<Error> no_descriptor() {
  return work_error(std::string("no descriptor to wait for lines with: ") + std::strerror(errno),
                    "raise the limit of open files");
}

}  // namespace

LineEvents::~LineEvents() {
  if (timer_ >= 0) ::close(timer_);
  if (epoll_ >= 0) ::close(epoll_);
}

Result<void> LineEvents::open() {
  epoll_ = epoll_create1(EPOLL_CLOEXEC);
  if (epoll_ < 0) return no_descriptor();
  epoll_event event{};
  const timespec at_once{};
  if (epoll_pwait2(epoll_, &event, 1, &at_once, nullptr) >= 0 || errno == EINTR) return {};
  timer_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
  event.events = EPOLLIN;  // without a line behind it
  if (timer_ < 0 || epoll_ctl(epoll_, EPOLL_CTL_ADD, timer_, &event) != 0) return no_descriptor();
  return {};
}

int LineEvents::wait(std::span<epoll_event> events, HostTime until) noexcept {
  int n = 0;
  if (timer_ >= 0) {
    n = wait_with_timer(events, until);
  } else {
    const timespec timeout = timespec_of(std::max<std::int64_t>((until - host_now()).count(), 0));
    n = epoll_pwait2(epoll_, events.data(), static_cast<int>(events.size()), &timeout, nullptr);
  }
  if (n >= 0) return n;
  // At real-time priority a loop that turns without waiting would take the processor for itself.
  if (errno != EINTR) sleep_until(until);
  return 0;
}

int LineEvents::wait_with_timer(std::span<epoll_event> events, HostTime until) noexcept {
  // An instant of 0 would stop the timer; one that has passed fires at once.
  const itimerspec alarm{{}, timespec_of(std::max<std::int64_t>(to_ns(until), 1))};
  if (timerfd_settime(timer_, TFD_TIMER_ABSTIME, &alarm, nullptr) != 0) return -1;
  const int n = epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), -1);
  const auto lines = std::remove_if(events.begin(), events.begin() + std::max(n, 0),
                                    [](const epoll_event& event) { return event.data.ptr == nullptr; });
  return n < 0 ? n : static_cast<int>(lines - events.begin());
}

}  // namespace imuscope
