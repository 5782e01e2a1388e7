#include "service/live/systemd_notify.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <array>
#include <cstdlib>
#include <cstring>

#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

/// What systemd does: a datagram socket whose name is in the environment.
class SystemdNotifyTest : public testing::Test {
 protected:
  void SetUp() override {
    // A socket's name holds at most 107 characters, fewer than a scratch folder may have.
    path_ = "/tmp/imuscope-notify-" + std::to_string(getpid());
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strcpy(address.sun_path, path_.c_str());
    ASSERT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", path_.c_str(), 1);
    setenv("WATCHDOG_USEC", "10000000", 1);
  }
  void TearDown() override {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    ::close(socket_);
    ::unlink(path_.c_str());
  }
  /// The next message; empty where there is none.
  std::string heard() const {
    std::array<char, 512> text{};
    const ssize_t n = ::recv(socket_, text.data(), text.size(), 0);
    return n > 0 ? std::string(text.data(), static_cast<std::size_t>(n)) : std::string();
  }

  std::string path_;
  int socket_ = -1;
};

TEST_F(SystemdNotifyTest, SpeaksTheWordsOfSdNotify) {
  const SystemdNotify systemd;
  systemd.ready("recording");
  EXPECT_EQ(heard(), "READY=1\nSTATUS=recording");
  systemd.status("running");
  EXPECT_EQ(heard(), "STATUS=running");
  systemd.reloading(host_time_from_ns(1'234'567'000));
  EXPECT_EQ(heard(), "RELOADING=1\nMONOTONIC_USEC=1234567");
  systemd.stopping();
  EXPECT_EQ(heard(), "STOPPING=1");
}

TEST_F(SystemdNotifyTest, ANamesNewLineIsNoAssignment) {
  const SystemdNotify systemd;
  systemd.ready("recording into runs/car\nMAINPID=1\n");
  EXPECT_EQ(heard(), "READY=1\nSTATUS=recording into runs/car?MAINPID=1?");
  systemd.status("a\nb");
  EXPECT_EQ(heard(), "STATUS=a?b");
}

TEST_F(SystemdNotifyTest, ASystemdThatDoesNotReadHoldsNobody) {
  const SystemdNotify systemd;
  for (int i = 0; i < 10'000; ++i) systemd.status(std::to_string(i));
  EXPECT_EQ(heard(), "STATUS=0");
}

TEST_F(SystemdNotifyTest, GivesASignOfLifeTwiceInTheTimeGranted) {
  SystemdNotify systemd;
  const HostTime begin = host_time_from_ns(1'000'000'000'000);
  int signs = 0;
  for (int i = 0; i <= 300; ++i) {  // 30 s, looked at every 100 ms
    systemd.alive(begin + i * std::chrono::milliseconds(100));
    while (heard() == "WATCHDOG=1") ++signs;
  }
  EXPECT_EQ(signs, 7) << "at 0, 5, 10, ... 30 s";
}

TEST_F(SystemdNotifyTest, IsSilentWithoutSystemdAndWithoutAWatchdog) {
  unsetenv("WATCHDOG_USEC");
  SystemdNotify without_watchdog;
  without_watchdog.alive(host_time_from_ns(1'000'000'000'000));
  EXPECT_EQ(heard(), "");
  unsetenv("NOTIFY_SOCKET");
  const SystemdNotify alone;
  alone.ready("nobody listens");
  EXPECT_EQ(heard(), "");
}

}  // namespace
}  // namespace imuscope
