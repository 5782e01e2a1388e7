#include "service/lines/device_events.h"

#include <libudev.h>
#include <poll.h>
#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

namespace imuscope {

DeviceEvents::DeviceEvents() : udev_(udev_new()) {
  if (udev_ == nullptr) return;
  std::error_code ignored;
  const bool udev_runs = std::filesystem::exists("/run/udev/control", ignored);
  monitor_ = udev_monitor_new_from_netlink(udev_, udev_runs ? "udev" : "kernel");
  if (monitor_ == nullptr) return;
  // Serial ports, adapters of CAN.
  udev_monitor_filter_add_match_subsystem_devtype(monitor_, "tty", nullptr);
  udev_monitor_filter_add_match_subsystem_devtype(monitor_, "net", nullptr);
  if (udev_monitor_enable_receiving(monitor_) < 0) monitor_ = udev_monitor_unref(monitor_);
}

DeviceEvents::~DeviceEvents() {
  if (monitor_ != nullptr) udev_monitor_unref(monitor_);
  if (udev_ != nullptr) udev_unref(udev_);
}

bool DeviceEvents::wait(Duration at_most) {
  if (monitor_ == nullptr) {
    std::this_thread::sleep_for(at_most);
    return false;
  }
  pollfd waits{udev_monitor_get_fd(monitor_), POLLIN, 0};
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(at_most);
  if (poll(&waits, 1, static_cast<int>(ms.count())) <= 0) return false;
  bool came = false;
  // A hub that is plugged in brings several at once.
  while (udev_device* const device = udev_monitor_receive_device(monitor_)) {
    const char* const action = udev_device_get_action(device);
    came = came || (action != nullptr && std::strcmp(action, "remove") != 0);
    udev_device_unref(device);
  }
  // What goes, or was not meant for us, makes nobody turn faster.
  if (!came) std::this_thread::sleep_for(std::min<Duration>(at_most, std::chrono::milliseconds(20)));
  return came;
}

}  // namespace imuscope
