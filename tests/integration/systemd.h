#pragma once

/// What systemd does for a service: a socket that hears its signs of life.

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

namespace imuscope::test {

/// As long as it lives, programs that are started find it in their environment.
class Systemd {
 public:
  /// @param watchdog  within which two signs of life are due
  explicit Systemd(std::chrono::microseconds watchdog)
      // A socket's name holds at most 107 characters, fewer than a scratch folder may have.
      : path_("/tmp/imuscope-systemd-" + std::to_string(getpid())),
        socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strcpy(address.sun_path, path_.c_str());
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", path_.c_str(), 1);
    setenv("WATCHDOG_USEC", std::to_string(watchdog.count()).c_str(), 1);
  }
  ~Systemd() {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(socket_);
    unlink(path_.c_str());
  }
  Systemd(const Systemd&) = delete;
  Systemd& operator=(const Systemd&) = delete;

  /// Signs of life since the last call.
  [[nodiscard]] int signs() const {
    int count = 0;
    std::array<char, 1024> text{};
    for (ssize_t n = 0; (n = recv(socket_, text.data(), text.size(), 0)) > 0;)
      count += std::string_view(text.data(), static_cast<std::size_t>(n)) == "WATCHDOG=1" ? 1 : 0;
    return count;
  }

 private:
  std::string path_;
  int socket_;
};

}  // namespace imuscope::test
