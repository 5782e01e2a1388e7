#include "firmware_sim/io/tcp_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace imusim {

tl::expected<TcpServer, std::string> TcpServer::open(const std::string& address, std::uint16_t port,
                                                     Bytes greeting) {
  sockaddr_in here{};
  here.sin_family = AF_INET;
  here.sin_port = htons(port);
  const std::string number = address == "localhost" || address.empty() ? "127.0.0.1" : address;
  if (::inet_pton(AF_INET, number.c_str(), &here.sin_addr) != 1)
    return tl::unexpected(fmt::format("'{}' is not an IPv4 address", address));
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int on = 1;
  if (listener < 0 || ::setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
      ::bind(listener, reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0 ||
      ::listen(listener, 1) != 0) {
    const int cause = errno;
    if (listener >= 0) ::close(listener);
    return tl::unexpected(fmt::format("cannot listen on {}:{}: {}", number, port, std::strerror(cause)));
  }
  return TcpServer(listener, std::move(greeting));
}

TcpServer::TcpServer(TcpServer&& other) noexcept
    : LineEnd(std::move(other)),
      listener_(std::exchange(other.listener_, -1)),
      client_(std::exchange(other.client_, -1)),
      greeting_(std::move(other.greeting_)) {}

TcpServer::~TcpServer() {
  drop_client();
  if (listener_ >= 0) ::close(listener_);
}

std::uint16_t TcpServer::port() const {
  sockaddr_in here{};
  socklen_t size = sizeof here;
  (void)::getsockname(listener_, reinterpret_cast<sockaddr*>(&here), &size);
  return ntohs(here.sin_port);
}

void TcpServer::drop_client() {
  if (client_ >= 0) ::close(std::exchange(client_, -1));
}

void TcpServer::look_for_client() {
  if (client_ >= 0) return;
  client_ = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (client_ < 0) return;
  const int on = 1;
  (void)::setsockopt(client_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  if (!greeting_.empty()) (void)::send(client_, greeting_.data(), greeting_.size(), MSG_NOSIGNAL);
}

std::size_t TcpServer::write(std::span<const std::uint8_t> bytes) {
  look_for_client();
  if (client_ < 0 || bytes.empty()) return bytes.size();
  const ssize_t sent = ::send(client_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (sent < 0 && errno != EAGAIN && errno != EINTR) drop_client();
  return bytes.size() - static_cast<std::size_t>(sent > 0 ? sent : 0);
}

Bytes TcpServer::read() {
  look_for_client();
  Bytes result;
  std::array<std::uint8_t, 1024> chunk{};
  while (client_ >= 0) {
    const ssize_t count = ::recv(client_, chunk.data(), chunk.size(), 0);
    if (count == 0) drop_client();
    if (count <= 0) break;
    result.insert(result.end(), chunk.begin(), chunk.begin() + count);
  }
  return result;
}

}  // namespace imusim
