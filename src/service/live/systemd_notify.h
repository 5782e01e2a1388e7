#pragma once

/// Tells systemd how the service is: the datagram protocol of sd_notify(3), which needs no library. Without
/// systemd (no NOTIFY_SOCKET) every call does nothing.

#include <optional>
#include <string>

#include "base/time.h"

namespace imuscope {

class SystemdNotify {
 public:
  /// Reads NOTIFY_SOCKET and WATCHDOG_USEC from the environment.
  SystemdNotify();
  ~SystemdNotify();
  SystemdNotify(const SystemdNotify&) = delete;
  SystemdNotify& operator=(const SystemdNotify&) = delete;

  void ready(const std::string& status) const;  ///< also ends a reload
  void status(const std::string& text) const;   ///< shown by systemctl status
  void reloading(HostTime now) const;
  void stopping() const;

  /// Sends a sign of life when one is due: twice in the time that systemd grants. Call only while the service
  /// does its work; what stops calling is started anew.
  void alive(HostTime now);

 private:
  void send(const std::string& message) const;

  int socket_ = -1;
  std::string address_;
  std::optional<Duration> sign_period_;
  HostTime last_sign_{};
};

}  // namespace imuscope
