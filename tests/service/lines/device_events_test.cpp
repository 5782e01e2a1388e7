/// What udev announces, forged in a network namespace of its own: the kernel's netlink and libudev's format.

#include "service/lines/device_events.h"

#include <gtest/gtest.h>

#include <linux/netlink.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

namespace imuscope {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr unsigned kKernelGroup = 1;

/// An event as the kernel sends it: "ACTION@DEVPATH" and properties, each with a zero after.
void announce(const std::string& action, const std::string& subsystem) {
  const int line = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_KOBJECT_UEVENT);
  sockaddr_nl address{};
  address.nl_family = AF_NETLINK;
  address.nl_groups = kKernelGroup;
  std::string message;
  for (const auto& part :
       {action + "@/devices/platform/imu", "ACTION=" + action, std::string("DEVPATH=/devices/platform/imu"),
        "SUBSYSTEM=" + subsystem, std::string("SEQNUM=1")})
    message += part + '\0';
  (void)sendto(line, message.data(), message.size(), 0, reinterpret_cast<const sockaddr*>(&address),
               sizeof address);
  close(line);
}

TEST(DeviceEvents, WithoutAnEventItWaitsItsTime) {
  DeviceEvents events;
  const auto begin = steady_clock::now();
  (void)events.wait(milliseconds(100));
  EXPECT_GE(steady_clock::now() - begin, milliseconds(20));
}

TEST(DeviceEvents, WhatComesWakesItAtOnceAndWhatGoesDoesNot) {
  if (std::filesystem::exists("/run/udev/control"))
    GTEST_SKIP() << "this PC's udev announces nothing in a private network";
  if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network needs root";
  DeviceEvents events;
  std::thread plug([] {
    std::this_thread::sleep_for(milliseconds(200));
    if (std::system("ip link add imu0 type veth peer name imu1") != 0) ADD_FAILURE();
  });
  EXPECT_TRUE(events.wait(std::chrono::seconds(20)));
  plug.join();
  while (events.wait(milliseconds(300))) continue;
  ASSERT_EQ(std::system("ip link del imu0"), 0);
  bool came = false;
  for (int i = 0; i < 5; ++i) came = events.wait(milliseconds(50)) || came;
  EXPECT_FALSE(came);
}

// A message of a user's program has a sender, and the kernel's have none: libudev drops it, as it must. What
// stands here is that forged announcements move nothing; real ones are seen by tools/systemd_vm.
TEST(DeviceEvents, WhatNoKernelAndNoUdevSaidIsNotBelieved) {
  if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network needs root";
  DeviceEvents events;
  announce("add", "tty");
  EXPECT_FALSE(events.wait(milliseconds(300)));
}

}  // namespace
}  // namespace imuscope
