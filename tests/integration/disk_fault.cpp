/// Preloaded into the unmodified `imuscope`, this library is the disk under the capture: what the file named
/// by DISK_FAULT_CONTROL says decides what becomes of each write to capture.lcm. "slow": it takes 0.4 s;
/// "gone": EIO, as from a disk that was pulled out; "full": ENOSPC; anything else: it works.

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/types.h>
#include <unistd.h>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

#include "fault_control.h"

namespace {

bool is_capture(int fd) {
  char link[64];
  char path[512];
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t n = readlink(link, path, sizeof path - 1);
  if (n <= 0) return false;
  path[n] = '\0';
  const char* const name = strrchr(path, '/');
  return name != nullptr && strcmp(name, "/capture.lcm") == 0;
}

char mode() { return fault_letter("DISK_FAULT_CONTROL"); }

}  // namespace

extern "C" ssize_t write(int fd, const void* buffer, size_t size) {
  using Write = ssize_t(int, const void*, size_t);
  static auto* const real = reinterpret_cast<Write*>(dlsym(RTLD_NEXT, "write"));
  if (!is_capture(fd)) return real(fd, buffer, size);
  switch (mode()) {
    case 's': {
      const timespec pause{0, 400'000'000};
      nanosleep(&pause, nullptr);
      break;
    }
    case 'g':
      errno = EIO;
      return -1;
    case 'f':
      errno = ENOSPC;
      return -1;
    default:
      break;
  }
  return real(fd, buffer, size);
}
