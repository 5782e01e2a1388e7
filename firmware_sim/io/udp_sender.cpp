#include "firmware_sim/io/udp_sender.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cerrno>
#include <cstring>
#include <utility>

namespace imusim {

tl::expected<UdpSender, std::string> UdpSender::open(const std::string& address, std::uint16_t port) {
  sockaddr_in there{};
  there.sin_family = AF_INET;
  there.sin_port = htons(port);
  const std::string number = address == "localhost" || address.empty() ? "127.0.0.1" : address;
  if (::inet_pton(AF_INET, number.c_str(), &there.sin_addr) != 1)
    return tl::unexpected(fmt::format("'{}' is not an IPv4 address", address));
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket < 0 || ::connect(socket, reinterpret_cast<const sockaddr*>(&there), sizeof there) != 0) {
    const int cause = errno;
    if (socket >= 0) ::close(socket);
    return tl::unexpected(fmt::format("cannot send to {}:{}: {}", number, port, std::strerror(cause)));
  }
  return UdpSender(socket);
}

UdpSender::UdpSender(UdpSender&& other) noexcept
    : LineEnd(std::move(other)), socket_(std::exchange(other.socket_, -1)) {}

UdpSender::~UdpSender() {
  if (socket_ >= 0) ::close(socket_);
}

// Where nobody listens, the PC says so at the next datagram (ECONNREFUSED): that one is dropped, and so on.
std::size_t UdpSender::write(std::span<const std::uint8_t> bytes) {
  const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  return bytes.size() - static_cast<std::size_t>(sent > 0 ? sent : 0);
}

}  // namespace imusim
