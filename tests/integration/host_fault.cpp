/// Preloaded into the unmodified `imuscope`, this library is a host in trouble. The first letter of the file
/// named by HOST_FAULT_CONTROL says which: "e" the estimator's thread gets no processor, "p" the publisher's
/// messages are not taken, "r" the recorder's disk does not answer, "f" it is full, "t" the wall clock is an
/// hour ahead. Threads are held for as long as the file says so.

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>
#include <cerrno>
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

extern "C" int clock_gettime(clockid_t clock, timespec* time) {
  static auto* const get = real<int(clockid_t, timespec*)>("clock_gettime");
  const int result = get(clock, time);
  constexpr time_t kStep_s = 3600;
  if (clock == CLOCK_REALTIME && result == 0 && mode() == 't') time->tv_sec += kStep_s;
  return result;
}
