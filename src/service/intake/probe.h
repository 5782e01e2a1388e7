#pragma once

/// Looks at serial ports: at which baud rate something speaks, which protocol, which device. For drafting a
/// configuration; blocks while it listens.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"

namespace imuscope {

/// What was found on one port. Without a protocol only `port` and `problem` say something.
struct ProbedPort {
  std::string port;
  std::optional<Protocol> protocol;  ///< absent: nothing was understood, `problem` says what was heard
  std::uint32_t baud = 0;
  std::string device_id;          ///< as the device gives it; empty where its protocol has none
  std::optional<double> rate_hz;  ///< of its samples, or of its messages where it sends none
  std::string problem;            ///< in one sentence, with the remedy
};

/// Listens on one port at all usual baud rates, and asks where nothing is heard. A device that streams is
/// interrupted for its identification and streams on; no setting is changed. An XSens device that waits in
/// its configuration state stays there.
[[nodiscard]] ProbedPort probe_port(const std::string& port);

/// Several ports at the same time.
[[nodiscard]] std::vector<ProbedPort> probe_ports(const std::vector<std::string>& ports);

}  // namespace imuscope
