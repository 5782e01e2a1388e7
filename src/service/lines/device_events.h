#pragma once

/// Tells when a device comes: what udev announces of serial ports and network interfaces. Non-real-time.

#include "base/time.h"

struct udev;
struct udev_monitor;

namespace imuscope {

/// Thread: one.
class DeviceEvents {
 public:
  /// Listens to udev, whose announcements come when names and rights are set; where no udev runs, to the
  /// kernel. Where neither can be listened to, nothing is ever announced.
  DeviceEvents();
  ~DeviceEvents();
  DeviceEvents(const DeviceEvents&) = delete;
  DeviceEvents& operator=(const DeviceEvents&) = delete;

  /// Waits until something comes, at most so long.
  /// @return whether something came
  [[nodiscard]] bool wait(Duration at_most);

 private:
  udev* udev_ = nullptr;
  udev_monitor* monitor_ = nullptr;
};

}  // namespace imuscope
