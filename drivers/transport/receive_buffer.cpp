#include "drivers/transport/receive_buffer.h"

#include <fmt/format.h>
#include <sys/socket.h>

namespace imuscope {

int grow_receive_buffer(int fd, int wanted_bytes) noexcept {
  constexpr socklen_t kSize = sizeof wanted_bytes;
  if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &wanted_bytes, kSize) != 0)
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &wanted_bytes, kSize);
  int granted = 0;
  socklen_t size = sizeof granted;
  getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &size);
  return granted / 2;  // the kernel doubles what is asked for, for its own overhead
}

std::string buffer_shortage(int granted_bytes, int wanted_bytes) {
  if (granted_bytes >= wanted_bytes) return {};
  constexpr int kKilo = 1024;
  return fmt::format("room for {} kB of {} wanted: sudo sysctl net.core.rmem_max={}", granted_bytes / kKilo,
                     wanted_bytes / kKilo, wanted_bytes);
}

}  // namespace imuscope
