#include "service/live/systemd_notify.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>

#include "base/text.h"

namespace imuscope {

SystemdNotify::SystemdNotify() {
  const char* address = std::getenv("NOTIFY_SOCKET");
  if (address == nullptr || std::strlen(address) < 2 || std::strlen(address) >= sizeof(sockaddr_un::sun_path))
    return;
  address_ = address;
  if (address_.front() == '@') address_.front() = '\0';  // the abstract namespace
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const char* watchdog = std::getenv("WATCHDOG_USEC");
  std::int64_t us = 0;
  if (watchdog == nullptr) return;
  const auto [end, error] = std::from_chars(watchdog, watchdog + std::strlen(watchdog), us);
  if (error == std::errc() && *end == '\0' && us > 0) sign_period_ = std::chrono::microseconds(us / 2);
}

SystemdNotify::~SystemdNotify() {
  if (socket_ >= 0) ::close(socket_);
}

// A line is an assignment of its own: a status may hold names of others.
void SystemdNotify::ready(const std::string& status) const { send("READY=1\nSTATUS=" + printable(status)); }
void SystemdNotify::status(const std::string& text) const { send("STATUS=" + printable(text)); }
void SystemdNotify::stopping() const { send("STOPPING=1"); }

void SystemdNotify::reloading(HostTime now) const {
  send(fmt::format("RELOADING=1\nMONOTONIC_USEC={}", to_ns(now) / 1000));
}

void SystemdNotify::alive(HostTime now) {
  if (!sign_period_ || now - last_sign_ < *sign_period_) return;
  last_sign_ = now;
  send("WATCHDOG=1");
}

void SystemdNotify::send(const std::string& message) const {
  if (socket_ < 0) return;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, address_.data(), address_.size());
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  // Lost where systemd does not listen: there is nobody else to tell, and nothing to wait for.
  (void)::sendto(socket_, message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT,
                 reinterpret_cast<const sockaddr*>(&address), length);
}

}  // namespace imuscope
