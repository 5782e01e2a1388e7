#include "tests/support/refused_calls.h"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <ctime>
#include <utility>

namespace imuscope::test {
namespace {

struct Refusal {
  int error = 0;
  int left = 0;
};

thread_local std::array<Refusal, kRefusableCalls> refusals;

Refusal& refusal_of(Call call) noexcept { return refusals[static_cast<std::size_t>(call)]; }

bool refuses(Call call) noexcept {
  Refusal& refusal = refusal_of(call);
  if (refusal.left == 0) return false;
  --refusal.left;
  errno = refusal.error;
  return true;
}

std::atomic<std::uint64_t> bytes_synced{0};
thread_local std::uint64_t bytes_unsynced = 0;

std::atomic<bool> disk_stands_still{false};
std::atomic<int> calls_waiting{0};
thread_local bool stalls_the_disk = false;

void wait_for_the_disk() noexcept {
  if (stalls_the_disk || !disk_stands_still.load()) return;
  calls_waiting += 1;
  const timespec pause{0, 1'000'000};
  while (disk_stands_still.load()) (void)nanosleep(&pause, nullptr);
  calls_waiting -= 1;
}

}  // namespace

std::uint64_t synced_bytes() noexcept { return bytes_synced.load(); }

StalledDisk::StalledDisk() noexcept {
  stalls_the_disk = true;
  disk_stands_still.store(true);
}

StalledDisk::~StalledDisk() {
  disk_stands_still.store(false);
  stalls_the_disk = false;
}

int StalledDisk::waiting() const noexcept { return calls_waiting.load(); }

RefusedCalls::RefusedCalls(Call call, int error, int times) noexcept : call_(call) {
  refusal_of(call) = {error, times};
}

RefusedCalls::~RefusedCalls() { refusal_of(call_) = {}; }

int RefusedCalls::left() const noexcept { return refusal_of(call_).left; }

}  // namespace imuscope::test

// In place of those of the C library, for the whole program.

extern "C" {

ssize_t read(int fd, void* bytes, std::size_t n) {
  if (imuscope::test::refuses(imuscope::test::Call::kRead)) return -1;
  return syscall(SYS_read, fd, bytes, n);
}

ssize_t write(int fd, const void* bytes, std::size_t n) {
  if (imuscope::test::refuses(imuscope::test::Call::kWrite)) return -1;
  imuscope::test::wait_for_the_disk();
  const ssize_t written = syscall(SYS_write, fd, bytes, n);
  if (written > 0) imuscope::test::bytes_unsynced += static_cast<std::uint64_t>(written);
  return written;
}

ssize_t pwrite(int fd, const void* bytes, std::size_t n, off_t offset) {
  if (imuscope::test::refuses(imuscope::test::Call::kPwrite)) return -1;
  return syscall(SYS_pwrite64, fd, bytes, n, offset);
}

ssize_t pread(int fd, void* bytes, std::size_t n, off_t offset) {
  if (imuscope::test::refuses(imuscope::test::Call::kPread)) return -1;
  return syscall(SYS_pread64, fd, bytes, n, offset);
}

ssize_t recvmsg(int fd, msghdr* message, int flags) {
  if (imuscope::test::refuses(imuscope::test::Call::kRecv)) return -1;
  return syscall(SYS_recvmsg, fd, message, flags);
}

ssize_t send(int fd, const void* bytes, std::size_t n, int flags) {
  if (imuscope::test::refuses(imuscope::test::Call::kSend)) return -1;
  return syscall(SYS_sendto, fd, bytes, n, flags, nullptr, 0);
}

int epoll_pwait2(int epoll, epoll_event* events, int n, const timespec* timeout, const sigset_t* mask) {
  if (imuscope::test::refuses(imuscope::test::Call::kEpollPwait2)) return -1;
  constexpr std::size_t kKernelsSignalSet = 8;  // bytes
  return static_cast<int>(syscall(SYS_epoll_pwait2, epoll, events, n, timeout, mask, kKernelsSignalSet));
}

int fdatasync(int fd) {
  if (imuscope::test::refuses(imuscope::test::Call::kFdatasync)) return -1;
  imuscope::test::wait_for_the_disk();
  imuscope::test::bytes_synced += std::exchange(imuscope::test::bytes_unsynced, 0);
  return static_cast<int>(syscall(SYS_fdatasync, fd));
}
}
