#include "made_can_kernel.h"

#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstring>

namespace imuscope::test {

MadeCanKernel& made_can_kernel() {
  static MadeCanKernel kernel;
  return kernel;
}

namespace {

int refused(int error) {
  errno = error;
  return -1;
}

}  // namespace
}  // namespace imuscope::test

using imuscope::test::made_can_kernel;
using imuscope::test::refused;

// In place of those of the C library, for the whole program.

extern "C" {

int socket(int domain, int type, int protocol) noexcept {
  auto& kernel = made_can_kernel();
  const int error = domain == PF_CAN ? kernel.socket_error : domain == PF_NETLINK ? kernel.netlink_error : 0;
  if (error != 0) return refused(error);
  if (domain != PF_CAN && domain != PF_NETLINK)
    return static_cast<int>(syscall(SYS_socket, domain, type, protocol));
  return static_cast<int>(syscall(SYS_socket, AF_UNIX, SOCK_DGRAM | (type & ~0xF), 0));
}

ssize_t send(int, const void* bytes, std::size_t n, int) {
  const auto* begin = static_cast<const std::uint8_t*>(bytes);
  made_can_kernel().asked.assign(begin, begin + n);
  return static_cast<ssize_t>(n);
}

ssize_t recv(int, void* bytes, std::size_t n, int) {
  auto& kernel = made_can_kernel();
  if (kernel.receive_error != 0) return refused(kernel.receive_error);
  const std::size_t size = std::min(n, kernel.answer.size());
  std::memcpy(bytes, kernel.answer.data(), size);
  return static_cast<ssize_t>(size);
}

int recvmmsg(int, mmsghdr* messages, unsigned n, int, timespec*) {
  auto& kernel = made_can_kernel();
  if (kernel.interrupted > 0) {
    --kernel.interrupted;
    return refused(EINTR);
  }
  if (kernel.receive_error != 0) return refused(kernel.receive_error);
  kernel.said += "room " + std::to_string(n) + '\n';
  const std::size_t taken = std::min<std::size_t>(n, kernel.frames.size());
  for (std::size_t i = 0; i < taken; ++i) {
    msghdr& header = messages[i].msg_hdr;
    const auto& frame = kernel.frames[i];
    std::memcpy(header.msg_iov->iov_base, &frame.frame, sizeof frame.frame);
    messages[i].msg_len = frame.n_bytes;
    header.msg_controllen = std::min<std::size_t>(header.msg_controllen, frame.control.size());
    if (header.msg_controllen > 0)
      std::memcpy(header.msg_control, frame.control.data(), header.msg_controllen);
  }
  kernel.frames.erase(kernel.frames.begin(), kernel.frames.begin() + static_cast<std::ptrdiff_t>(taken));
  return static_cast<int>(taken);
}

int setsockopt(int fd, int level, int option, const void* value, socklen_t size) noexcept {
  auto& kernel = made_can_kernel();
  if (level != SOL_CAN_RAW) return static_cast<int>(syscall(SYS_setsockopt, fd, level, option, value, size));
  kernel.said += "option " + std::to_string(option) + ':';
  for (socklen_t at = 0; at + 4 <= size; at += 4) {
    std::uint32_t word = 0;
    std::memcpy(&word, static_cast<const std::uint8_t*>(value) + at, sizeof word);
    kernel.said += ' ' + std::to_string(word >> 16U) + '.' + std::to_string(word & 0xFFFFU);
  }
  kernel.said += '\n';
  return option == kernel.option_that_fails ? refused(EINVAL) : 0;
}

int bind(int fd, const sockaddr* address, socklen_t size) noexcept {
  auto& kernel = made_can_kernel();
  if (address->sa_family != AF_CAN) return static_cast<int>(syscall(SYS_bind, fd, address, size));
  sockaddr_can can{};
  std::memcpy(&can, address, sizeof can);
  kernel.said += "bound to " + std::to_string(can.can_ifindex) + '\n';
  return kernel.bind_error != 0 ? refused(kernel.bind_error) : 0;
}

unsigned if_nametoindex(const char* name) noexcept { return std::strcmp(name, "can7") == 0 ? 7U : 0U; }

int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (request != SIOCGIFFLAGS) return static_cast<int>(syscall(SYS_ioctl, fd, request, argument));
  auto& kernel = made_can_kernel();
  if (kernel.flags_error != 0) return refused(kernel.flags_error);
  auto* asked = static_cast<ifreq*>(argument);
  kernel.said += "flags of " + std::string(asked->ifr_name) + '\n';
  asked->ifr_flags = kernel.interface_flags;
  return 0;
}

}  // extern "C"
