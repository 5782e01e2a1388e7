#include "firmware_sim/io/can_port.h"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace imusim {

tl::expected<CanPort, std::string> CanPort::open(const std::string& interface) {
  const auto failed = [&](const std::string& what) {
    return tl::unexpected(
        fmt::format("{}; a virtual bus is made by: sudo ip link add {} type vcan && sudo ip link set {} up",
                    what, interface, interface));
  };
  const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0) return tl::unexpected(fmt::format("this kernel has no SocketCAN ({})", std::strerror(errno)));
  CanPort port(interface, fd);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  if (address.can_ifindex == 0) return failed(fmt::format("CAN interface {} does not exist", interface));
  // A sender that hears nothing: no filter lets a frame in.
  ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0);
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return failed(fmt::format("CAN interface {} cannot be used ({})", interface, std::strerror(errno)));
  return port;
}

CanPort::CanPort(CanPort&& other) noexcept
    : interface_(std::move(other.interface_)), socket_(std::exchange(other.socket_, -1)) {}

CanPort::~CanPort() {
  if (socket_ >= 0) ::close(socket_);
}

bool CanPort::write(const CanFrame& frame) {
  can_frame wire{};
  wire.can_id = frame.id;
  wire.len = static_cast<__u8>(std::min(frame.data.size(), sizeof wire.data));
  std::copy_n(frame.data.begin(), wire.len, std::begin(wire.data));
  return ::write(socket_, &wire, sizeof wire) == static_cast<ssize_t>(sizeof wire);
}

}  // namespace imusim
