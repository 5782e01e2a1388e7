/// Preloaded into the unmodified `imuscope`, this library is the PPS part of a kernel: the file that
/// PPS_DEVICE names answers the ioctls of a PPS device. What lies in it is the newest pulse, as `imusim live`
/// writes it (firmware_sim/io/pulse_line.h); it is stamped by the wall clock as the program sees that, as a
/// kernel would.

#include <dlfcn.h>
#include <fcntl.h>
#include <linux/pps.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;

std::atomic<int> device{-1};

template <typename Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

std::int64_t now_ns(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return now.tv_sec * kNsPerSecond + now.tv_nsec;
}

int fetch(pps_fdata* data) {
  constexpr std::size_t kRecordBytes = 32;
  constexpr std::size_t kCountAt = 4;
  constexpr std::size_t kHostAt = 8;
  std::array<std::uint8_t, kRecordBytes> record{};
  if (pread(device.load(), record.data(), record.size(), 0) < 0) return -1;
  data->info = {};
  std::int64_t host_ns = 0;
  std::memcpy(&data->info.assert_sequence, record.data() + kCountAt, sizeof data->info.assert_sequence);
  std::memcpy(&host_ns, record.data() + kHostAt, sizeof host_ns);
  const std::int64_t wall_ns = host_ns + now_ns(CLOCK_REALTIME) - now_ns(CLOCK_MONOTONIC);
  data->info.assert_tu = {wall_ns / kNsPerSecond, static_cast<__s32>(wall_ns % kNsPerSecond), 0};
  return 0;
}

}  // namespace

extern "C" int open(const char* path, int flags, ...) {
  static auto* const opens = real<int(const char*, int, mode_t)>("open");
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  const int fd = opens(path, flags, mode);
  const char* const wanted = std::getenv("PPS_DEVICE");
  if (fd >= 0 && wanted != nullptr && std::strcmp(path, wanted) == 0) device.store(fd);
  return fd;
}

extern "C" int ioctl(int fd, unsigned long request, ...) {
  static auto* const call = real<int(int, unsigned long, void*)>("ioctl");
  va_list rest;
  va_start(rest, request);
  void* const argument = va_arg(rest, void*);
  va_end(rest);
  if (fd < 0 || fd != device.load()) return call(fd, request, argument);
  switch (request) {
    case PPS_GETCAP:
      *static_cast<int*>(argument) = PPS_CAPTUREASSERT | PPS_TSFMT_TSPEC;
      return 0;
    case PPS_GETPARAMS:
      *static_cast<pps_kparams*>(argument) = {PPS_API_VERS_1, PPS_CAPTUREASSERT | PPS_TSFMT_TSPEC, {}, {}};
      return 0;
    case PPS_FETCH:
      return fetch(static_cast<pps_fdata*>(argument));
    default:
      errno = EPERM;
      return -1;
  }
}
