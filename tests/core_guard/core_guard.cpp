/// Preloaded into the unmodified `imuscope`, this library watches the threads of the core, told by their
/// names. From their hundredth wait on, it counts every allocation, every lock, every wait on a condition,
/// every read and write on a descriptor that could block, and every system call that is not on the thread's
/// short list (a seccomp filter on that thread alone). At the end of the process it writes what it saw to the
/// file named by CORE_GUARD_REPORT.
///
/// What it cannot see: a lock that is built from atomics and spins. ThreadSanitizer and the code's own rule
/// (rings and latest-value cells only) stand for that.

#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/pps.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <ucontext.h>
#include <unistd.h>
#include <atomic>
#include <iterator>

extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);
}

namespace {

constexpr long kWaitsBeforeArming = 100;
constexpr int kFrames = 24;
constexpr int kMaxDescriptors = 1024;

enum Offence { kAllocation, kFree, kLock, kConditionWait, kBlockingIo, kForbiddenCall, kOffences };
constexpr const char* kOffenceNames[kOffences] = {"allocations",     "frees",       "locks",
                                                  "condition_waits", "blocking_io", "forbidden_calls"};

struct Watched {
  const char* name;
  std::atomic<long> waits{0};  // since arming
  std::atomic<long> counts[kOffences] = {};
  // Of this turn: they count with the next wait. What follows the last one is the end of the thread, not a
  // turn.
  long turn[kOffences] = {};
  int turn_forbidden = -1;
  std::atomic<long> page_faults{0};
  std::atomic<int> last_forbidden{-1};
  long waits_before = 0;
  long faults_at_arming = 0;
  bool armed = false;
  signed char descriptor[kMaxDescriptors] = {};  // 1: does not block, 2: may block
  void* trace[kFrames] = {};
  std::atomic<int> frames{0};
};

Watched watched[] = {{"imuscope-io"}, {"imuscope-est"}};
__thread Watched* self = nullptr;
__thread bool busy = false;  // inside the guard itself

Watched* armed() { return self != nullptr && self->armed && !busy ? self : nullptr; }

/// Where the first offence happened.
void keep_trace(Watched& w) {
  if (w.frames.load() != 0) return;
  busy = true;
  w.frames.store(backtrace(w.trace, kFrames));
  busy = false;
}

void offend(Offence offence) {
  Watched* const w = armed();
  if (w == nullptr) return;
  ++w->turn[offence];
  keep_trace(*w);
}

long faults_of_thread() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt + usage.ru_majflt;
}

void on_forbidden_call(int, siginfo_t* info, void* context) {
  auto* const user = static_cast<ucontext_t*>(context);
  if (armed() != nullptr) {
    self->turn_forbidden = info->si_syscall;
    offend(kForbiddenCall);
  }
  user->uc_mcontext.gregs[REG_RAX] = -ENOSYS;
}

/// Everything else raises SIGSYS in this thread. The last row is what the end of a thread needs.
constexpr int kAllowedBoth[] = {SYS_clock_gettime, SYS_rt_sigreturn, SYS_restart_syscall,
                                SYS_getrusage,     SYS_exit,         SYS_exit_group,
                                SYS_madvise,       SYS_munmap,       SYS_rt_sigprocmask};
constexpr int kAllowedEstimator[] = {SYS_clock_nanosleep};
/// getsockopt: what the kernel counted of a datagram socket, copied without a lock.
constexpr int kAllowedIo[] = {SYS_epoll_wait, SYS_epoll_pwait2, SYS_epoll_ctl, SYS_read,
                              SYS_write,      SYS_recvmsg,      SYS_recvmmsg,  SYS_recvfrom,
                              SYS_sendto,     SYS_fcntl,        SYS_getsockopt};
/// Health of a line: the driver's error counts and an interface's flags, and the newest pulse of a PPS device
/// without waiting for one, all copied from the kernel's memory.
constexpr unsigned kAllowedIoctls[] = {TIOCGICOUNT, SIOCGIFFLAGS, static_cast<unsigned>(PPS_FETCH)};

void install_filter(bool is_io) {
  sock_filter program[64];
  size_t n = 0;
  const auto add = [&](sock_filter step) { program[n++] = step; };
  add(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)));
  const auto allow = [&](int call) {
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(call), 0, 1));
    add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  };
  for (const int call : kAllowedBoth) allow(call);
  if (is_io) {
    for (const int call : kAllowedIo) allow(call);
    constexpr unsigned char kSkipIoctls = 1 + 2 * std::size(kAllowedIoctls);
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_ioctl, 0, kSkipIoctls));
    add(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, args[1])));
    for (const unsigned request : kAllowedIoctls) {
      add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, request, 0, 1));
      add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
    }
  } else {
    for (const int call : kAllowedEstimator) allow(call);
  }
  add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP));
  sock_fprog filter{static_cast<unsigned short>(n), program};
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter, 0, 0) != 0) {
    self->counts[kForbiddenCall].store(-1);  // told as a failure: without the filter nothing is proved
  }
}

void count_wait() {
  if (self == nullptr) return;
  if (self->armed) {
    const long waits = self->waits.fetch_add(1);
    if (self->turn[kForbiddenCall] > 0) self->last_forbidden.store(self->turn_forbidden);
    for (int i = 0; i < kOffences; ++i) {
      self->counts[i].fetch_add(self->turn[i]);
      self->turn[i] = 0;
    }
    if (waits % 100 == 0) self->page_faults.store(faults_of_thread() - self->faults_at_arming);
    return;
  }
  if (++self->waits_before < kWaitsBeforeArming) return;
  self->faults_at_arming = faults_of_thread();
  install_filter(self == &watched[0]);
  self->armed = true;
}

void check_descriptor(int fd) {
  Watched* const w = armed();
  if (w == nullptr || fd < 0 || fd >= kMaxDescriptors) return;
  if (w->descriptor[fd] == 0) {
    w->descriptor[fd] = (syscall(SYS_fcntl, fd, F_GETFL) & O_NONBLOCK) != 0 ? 1 : 2;
  }
  if (w->descriptor[fd] == 2) offend(kBlockingIo);
}

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

__attribute__((constructor)) void begin() {
  void* frame[1];
  (void)backtrace(frame, 1);  // its first call loads a library
  struct sigaction action {};
  action.sa_sigaction = on_forbidden_call;
  action.sa_flags = SA_SIGINFO;
  sigaction(SIGSYS, &action, nullptr);
}

__attribute__((destructor)) void report() {
  const char* const path = getenv("CORE_GUARD_REPORT");
  if (path == nullptr) return;
  FILE* const file = fopen(path, "w");
  if (file == nullptr) return;
  for (const auto& w : watched) {
    fprintf(file, "%s waits %ld", w.name, w.waits.load());
    long offences = 0;
    for (int i = 0; i < kOffences; ++i) {
      fprintf(file, " %s %ld", kOffenceNames[i], w.counts[i].load());
      offences += w.counts[i].load();
    }
    fprintf(file, " last_forbidden %d page_faults %ld\n", w.last_forbidden.load(), w.page_faults.load());
    fflush(file);
    if (offences > 0 && w.frames.load() > 0)
      backtrace_symbols_fd(const_cast<void**>(w.trace), w.frames.load(), fileno(file));
  }
  fclose(file);
}

}  // namespace

extern "C" {

void* malloc(size_t size) {
  offend(kAllocation);
  return __libc_malloc(size);
}
void* calloc(size_t n, size_t size) {
  offend(kAllocation);
  return __libc_calloc(n, size);
}
void* realloc(void* block, size_t size) {
  offend(kAllocation);
  return __libc_realloc(block, size);
}
void* memalign(size_t alignment, size_t size) {
  offend(kAllocation);
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  offend(kAllocation);
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, size_t alignment, size_t size) {
  offend(kAllocation);
  *block = __libc_memalign(alignment, size);
  return *block != nullptr ? 0 : ENOMEM;
}
void free(void* block) {
  if (block != nullptr) offend(kFree);
  __libc_free(block);
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
  static auto* const real = next<int(pthread_mutex_t*)>("pthread_mutex_lock");
  offend(kLock);
  return real(mutex);
}
int pthread_mutex_trylock(pthread_mutex_t* mutex) {
  static auto* const real = next<int(pthread_mutex_t*)>("pthread_mutex_trylock");
  offend(kLock);
  return real(mutex);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) {
  static auto* const real = next<int(pthread_rwlock_t*)>("pthread_rwlock_rdlock");
  offend(kLock);
  return real(lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) {
  static auto* const real = next<int(pthread_rwlock_t*)>("pthread_rwlock_wrlock");
  offend(kLock);
  return real(lock);
}
int pthread_spin_lock(pthread_spinlock_t* lock) {
  static auto* const real = next<int(pthread_spinlock_t*)>("pthread_spin_lock");
  offend(kLock);
  return real(lock);
}
int sem_wait(sem_t* semaphore) {
  static auto* const real = next<int(sem_t*)>("sem_wait");
  offend(kLock);
  return real(semaphore);
}
int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  static auto* const real = next<int(pthread_cond_t*, pthread_mutex_t*)>("pthread_cond_wait");
  offend(kConditionWait);
  return real(condition, mutex);
}
int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  static auto* const real =
      next<int(pthread_cond_t*, pthread_mutex_t*, const timespec*)>("pthread_cond_timedwait");
  offend(kConditionWait);
  return real(condition, mutex, until);
}

int pthread_setname_np(pthread_t thread, const char* name) {
  static auto* const real = next<int(pthread_t, const char*)>("pthread_setname_np");
  if (pthread_equal(thread, pthread_self()) != 0) {
    for (auto& w : watched) {
      if (strcmp(w.name, name) == 0) self = &w;
    }
  }
  return real(thread, name);
}

int clock_nanosleep(clockid_t clock, int flags, const timespec* request, timespec* remain) {
  static auto* const real = next<int(clockid_t, int, const timespec*, timespec*)>("clock_nanosleep");
  count_wait();
  return real(clock, flags, request, remain);
}
int epoll_wait(int epoll, epoll_event* events, int max, int timeout) {
  static auto* const real = next<int(int, epoll_event*, int, int)>("epoll_wait");
  count_wait();
  return real(epoll, events, max, timeout);
}
int epoll_pwait2(int epoll, epoll_event* events, int max, const timespec* timeout, const sigset_t* mask) {
  static auto* const real =
      next<int(int, epoll_event*, int, const timespec*, const sigset_t*)>("epoll_pwait2");
  count_wait();
  return real(epoll, events, max, timeout, mask);
}
ssize_t read(int fd, void* buffer, size_t size) {
  static auto* const real = next<ssize_t(int, void*, size_t)>("read");
  check_descriptor(fd);
  return real(fd, buffer, size);
}
ssize_t recv(int fd, void* buffer, size_t size, int flags) {
  static auto* const real = next<ssize_t(int, void*, size_t, int)>("recv");
  if ((flags & MSG_DONTWAIT) == 0) check_descriptor(fd);
  return real(fd, buffer, size, flags);
}
ssize_t send(int fd, const void* buffer, size_t size, int flags) {
  static auto* const real = next<ssize_t(int, const void*, size_t, int)>("send");
  if ((flags & MSG_DONTWAIT) == 0) check_descriptor(fd);
  return real(fd, buffer, size, flags);
}
ssize_t write(int fd, const void* buffer, size_t size) {
  static auto* const real = next<ssize_t(int, const void*, size_t)>("write");
  check_descriptor(fd);
  return real(fd, buffer, size);
}
}
