#pragma once

/// Tells the two meanings of SIGHUP apart: "read the configuration again", which systemd and people send, and
/// "your terminal is gone", which the kernel and the shell send when its window is closed or ssh ends.

namespace imuscope {

/// The terminal that this process was started from, if any.
class ControllingTerminal {
 public:
  ControllingTerminal();
  /// Whether there was one at the start and it can no longer be reached. Non-real-time: opens a file.
  [[nodiscard]] bool is_gone() const;

 private:
  bool was_there_;
};

}  // namespace imuscope
