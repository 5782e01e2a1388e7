/// Preloaded into the unmodified `imuscope`, this library is a host in trouble. The first letter of the file
/// named by HOST_FAULT_CONTROL says which: "e" the estimator's thread gets no processor, "i" the I/O thread,
/// "p" the publisher's messages are not taken, "r" the recorder's disk does not answer, "f" it is full, "t"
/// the wall clock is an hour ahead, "b" an hour behind, "s" a second behind, "w" slewed by 500 ppm. Threads
/// are held for as long as the file says so. The kernel's stamps of received messages go by the same wall
/// clock.

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>

#include "fault_control.h"

namespace {

char mode() { return fault_letter("HOST_FAULT_CONTROL"); }

bool this_thread_is(const char* name) {
  char own[16] = {};
  return pthread_getname_np(pthread_self(), own, sizeof own) == 0 && strcmp(own, name) == 0;
}

void hold_while(char letter) {
  while (mode() == letter) {
    const timespec pause{0, 20'000'000};
    nanosleep(&pause, nullptr);
  }
}

template <typename Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" int clock_nanosleep(clockid_t clock, int flags, const timespec* until, timespec* left) {
  static auto* const sleep = real<int(clockid_t, int, const timespec*, timespec*)>("clock_nanosleep");
  const int result = sleep(clock, flags, until, left);
  if (this_thread_is("imuscope-est")) hold_while('e');
  return result;
}

extern "C" int epoll_pwait2(int fd, epoll_event* events, int size, const timespec* timeout,
                            const sigset_t* signals) {
  static auto* const wait =
      real<int(int, epoll_event*, int, const timespec*, const sigset_t*)>("epoll_pwait2");
  const int result = wait(fd, events, size, timeout, signals);
  if (this_thread_is("imuscope-io")) hold_while('i');
  return result;
}

extern "C" ssize_t sendmsg(int fd, const msghdr* message, int flags) {
  static auto* const send = real<ssize_t(int, const msghdr*, int)>("sendmsg");
  if (this_thread_is("imuscope-pub")) hold_while('p');
  return send(fd, message, flags);
}

extern "C" ssize_t write(int fd, const void* buffer, size_t size) {
  static auto* const put = real<ssize_t(int, const void*, size_t)>("write");
  if (this_thread_is("imuscope-rec")) {
    hold_while('r');
    if (mode() == 'f') {
      errno = ENOSPC;
      return -1;
    }
  }
  return put(fd, buffer, size);
}

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;

std::int64_t ns_of(const timespec& time) { return time.tv_sec * kNsPerSecond + time.tv_nsec; }

timespec moved(const timespec& time, std::int64_t by_ns) {
  const std::int64_t ns = ns_of(time) + by_ns;
  return {ns / kNsPerSecond, ns % kNsPerSecond};
}

/// Of the wall clock against the true one, by now.
std::int64_t wall_error_ns() {
  constexpr std::int64_t kHour_s = 3600;
  constexpr std::int64_t kSlewDivisor = 2000;  // 500 ppm
  static std::atomic<std::int64_t> slew_began{0};
  timespec now{};
  switch (mode()) {
    case 't':
      return kHour_s * kNsPerSecond;
    case 'b':
      return -kHour_s * kNsPerSecond;
    case 's':
      return -kNsPerSecond;
    case 'w': {
      real<int(clockid_t, timespec*)>("clock_gettime")(CLOCK_MONOTONIC, &now);
      std::int64_t none = 0;
      slew_began.compare_exchange_strong(none, ns_of(now));
      return (ns_of(now) - slew_began.load()) / kSlewDivisor;
    }
    default:
      return 0;
  }
}

}  // namespace

extern "C" ssize_t recvmsg(int fd, msghdr* message, int flags) {
  static auto* const receive = real<ssize_t(int, msghdr*, int)>("recvmsg");
  const ssize_t n = receive(fd, message, flags);
  for (cmsghdr* told = n >= 0 ? CMSG_FIRSTHDR(message) : nullptr; told != nullptr;
       told = CMSG_NXTHDR(message, told)) {
    // That of SO_TIMESTAMPING begins with the kernel's, too.
    const bool is_stamp = told->cmsg_type == SO_TIMESTAMPNS || told->cmsg_type == SO_TIMESTAMPING;
    if (told->cmsg_level != SOL_SOCKET || !is_stamp) continue;
    timespec stamp{};
    memcpy(&stamp, CMSG_DATA(told), sizeof stamp);
    if (ns_of(stamp) == 0) continue;
    stamp = moved(stamp, wall_error_ns());
    memcpy(CMSG_DATA(told), &stamp, sizeof stamp);
  }
  return n;
}

extern "C" int clock_gettime(clockid_t clock, timespec* time) {
  static auto* const get = real<int(clockid_t, timespec*)>("clock_gettime");
  const int result = get(clock, time);
  if (clock == CLOCK_REALTIME && result == 0) *time = moved(*time, wall_error_ns());
  return result;
}
