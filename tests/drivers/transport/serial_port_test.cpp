#include "drivers/transport/serial_port.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <numeric>
#include <thread>

#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

/// A pseudo-terminal with a stable name, as udev gives one to a plugged-in device.
class PluggedDevice {
 public:
  explicit PluggedDevice(const std::filesystem::path& name) {
    char path[128];
    int far_end = -1;
    EXPECT_EQ(openpty(&near_end_, &far_end, path, nullptr, nullptr), 0);
    close(far_end);
    const auto link = name.string() + ".new";
    std::filesystem::create_symlink(path, link);
    std::filesystem::rename(link, name);
  }
  ~PluggedDevice() { unplug(); }
  PluggedDevice(const PluggedDevice&) = delete;
  PluggedDevice& operator=(const PluggedDevice&) = delete;
  void unplug() {
    if (near_end_ >= 0) close(near_end_);
    near_end_ = -1;
  }
  [[nodiscard]] int near_end() const { return near_end_; }

 private:
  int near_end_ = -1;
};

class SerialPortTest : public testing::Test {
 protected:
  std::filesystem::path name_ = test::scratch_folder() / "mtx1";
  PluggedDevice device_{name_};
  SerialSettings settings_{name_.string(), 115200, 1};
};

bool becomes_readable(int fd) {
  pollfd wait{fd, POLLIN, 0};
  return poll(&wait, 1, 1000) == 1;
}

TEST_F(SerialPortTest, CarriesEveryByteValueBothWaysUnchanged) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port) << port.error().text();
  std::vector<std::uint8_t> all(256);
  std::iota(all.begin(), all.end(), std::uint8_t{0});
  ASSERT_EQ(write(device_.near_end(), all.data(), all.size()), 256);
  ASSERT_TRUE(becomes_readable(port->fd()));
  std::vector<std::uint8_t> got(300);
  const IoResult read_result = port->read(got);
  EXPECT_EQ(read_result.status, IoStatus::kDone);
  got.resize(read_result.n);
  EXPECT_EQ(got, all);

  EXPECT_EQ(port->write(all).n, 256U);
  std::vector<std::uint8_t> heard(300);
  heard.resize(static_cast<std::size_t>(read(device_.near_end(), heard.data(), heard.size())));
  EXPECT_EQ(heard, all);
}

TEST_F(SerialPortTest, NoDataIsNotTheEnd) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_EQ(port->read(buffer).status, IoStatus::kNothing);
}

TEST_F(SerialPortTest, TakesAnyBaudRateAndTellsTheRealOne) {
  for (const std::uint32_t baud :
       {9600U, 14400U, 28800U, 76800U, 115200U, 460800U, 921600U, 2000000U, 123456U}) {
    settings_.baud = baud;
    auto port = SerialPort::open(settings_);
    ASSERT_TRUE(port) << port.error().text();
    EXPECT_EQ(port->baud(), baud);
  }
  settings_.baud = 28800;
  settings_.stop_bits = 2;
  EXPECT_TRUE(SerialPort::open(settings_));
}

TEST_F(SerialPortTest, TellsHowLongAByteTakesWithItsStopBits) {
  settings_.baud = 100'000;  // 10 us a bit
  for (const int stop_bits : {1, 2}) {
    settings_.stop_bits = stop_bits;
    const auto port = SerialPort::open(settings_);
    ASSERT_TRUE(port) << port.error().text();
    EXPECT_EQ(port->timing().per_byte, std::chrono::microseconds(10) * (9 + stop_bits));
    EXPECT_EQ(port->timing().held, Duration::zero()) << "a pseudo-terminal has no adapter";
  }
}

TEST_F(SerialPortTest, ASecondProgramIsTurnedAwayAndToldWhoHoldsThePort) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  const auto second = SerialPort::open(settings_);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().what.find("in use by process this program"), std::string::npos)
      << second.error().what;
  port = SerialPort::open({(name_.string() + ".none"), 115200, 1});
}

/// A process of its own that runs `work` and ends with its result; killed where it does not end.
class OtherProcess {
 public:
  explicit OtherProcess(const std::function<bool()>& work) : pid_(fork()) {
    if (pid_ == 0) _exit(work() ? 0 : 1);
  }
  ~OtherProcess() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  OtherProcess(const OtherProcess&) = delete;
  OtherProcess& operator=(const OtherProcess&) = delete;
  [[nodiscard]] pid_t pid() const { return pid_; }
  bool succeeds() {
    int status = 0;
    const bool ended = waitpid(pid_, &status, 0) == pid_;
    pid_ = 0;
    return ended && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

 private:
  pid_t pid_;
};

TEST_F(SerialPortTest, ABusyPortNamesTheProgramThatHoldsItAndItsNumber) {
  std::array<int, 2> ready{};
  ASSERT_EQ(pipe(ready.data()), 0);
  const OtherProcess holder([&] {
    const auto port = SerialPort::open(settings_);
    if (write(ready[1], port ? "y" : "n", 1) == 1) pause();
    return false;
  });
  char answer = 0;
  ASSERT_EQ(read(ready[0], &answer, 1), 1);
  ASSERT_EQ(answer, 'y');
  const auto second = SerialPort::open(settings_);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().what.find(std::to_string(holder.pid()) + " (transport_tests)"), std::string::npos)
      << second.error().what;
  EXPECT_NE(second.error().remedy.find("stop that program"), std::string::npos);
  EXPECT_EQ(second.error().text().find('\n'), std::string::npos);
  close(ready[0]);
  close(ready[1]);
}

TEST_F(SerialPortTest, APortThatAnotherProgramReadsWithoutALockIsLeftAsItIs) {
  const auto baud = [&] {
    const int fd = ::open(name_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK);
    termios line{};
    tcgetattr(fd, &line);
    ::close(fd);
    return cfgetospeed(&line);
  };
  std::array<int, 2> ready{};
  ASSERT_EQ(pipe(ready.data()), 0);
  const OtherProcess reader([&] {
    const int fd = ::open(name_.c_str(), O_RDWR | O_NOCTTY);
    termios line{};
    const bool set =
        tcgetattr(fd, &line) == 0 && cfsetspeed(&line, B9600) == 0 && tcsetattr(fd, TCSANOW, &line) == 0;
    if (write(ready[1], set ? "y" : "n", 1) == 1) pause();
    return false;
  });
  char answer = 0;
  ASSERT_EQ(read(ready[0], &answer, 1), 1);
  ASSERT_EQ(answer, 'y');
  const auto port = SerialPort::open(settings_);
  ASSERT_FALSE(port);
  EXPECT_NE(port.error().what.find("in use by process " + std::to_string(reader.pid()) + " ("),
            std::string::npos)
      << port.error().what;
  EXPECT_EQ(baud(), B9600);
  close(ready[0]);
  close(ready[1]);
}

TEST_F(SerialPortTest, APseudoTerminalOfAnotherRootWithTheSameNameIsAnotherPort) {
  const auto name = std::filesystem::canonical(name_);
  std::array<int, 2> ready{};
  ASSERT_EQ(pipe(ready.data()), 0);
  const OtherProcess elsewhere([&] {
    char answer = 'n';
    if (unshare(CLONE_NEWNS) != 0 || mount("", "/", "", MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("devpts", "/dev/pts", "devpts", 0, "newinstance,ptmxmode=0666") != 0) {
      answer = '-';
    } else {
      // Numbers are given in order.
      while (answer == 'n' && open("/dev/pts/ptmx", O_RDWR | O_NOCTTY) >= 0) {
        if (std::filesystem::exists(name)) answer = open(name.c_str(), O_RDWR | O_NOCTTY) >= 0 ? 'y' : 'u';
        for (int on = 0, fd = 0; fd < 256; ++fd) (void)ioctl(fd, TIOCSPTLCK, &on);
      }
      if (answer == 'u') answer = open(name.c_str(), O_RDWR | O_NOCTTY) >= 0 ? 'y' : 'n';
    }
    if (write(ready[1], &answer, 1) == 1) pause();
    return false;
  });
  char answer = 0;
  ASSERT_EQ(read(ready[0], &answer, 1), 1);
  if (answer == '-') GTEST_SKIP() << "mounting needs root";
  ASSERT_EQ(answer, 'y');
  const auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  const auto second = SerialPort::open(settings_);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().what.find("in use by process this program"), std::string::npos)
      << second.error().what;
  close(ready[0]);
  close(ready[1]);
}

TEST_F(SerialPortTest, APortThatIsNotPermittedSaysHowToGetIt) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can become somebody who is not permitted";
  const auto terminal = std::filesystem::canonical(name_);
  ASSERT_EQ(chmod(terminal.c_str(), 0600), 0);
  OtherProcess stranger([&] {
    constexpr uid_t kNobody = 65534;
    if (setgid(kNobody) != 0 || setuid(kNobody) != 0) return false;
    // The folder of the link need not be open to everybody.
    const auto port = SerialPort::open({terminal.string(), 115200, 1});
    return !port &&
           port.error().what.find("no permission for port " + terminal.string()) != std::string::npos &&
           port.error().remedy.find("usermod -aG") != std::string::npos &&
           port.error().remedy.find("udev rule") != std::string::npos;
  });
  EXPECT_TRUE(stranger.succeeds());
}

TEST_F(SerialPortTest, WhatAPseudoTerminalCannotDoIsNoReasonToFail) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  EXPECT_FALSE(port->low_latency());
  EXPECT_FALSE(port->line_errors().has_value());
  EXPECT_EQ(port->health().frames_dropped, 0U);
  EXPECT_TRUE(port->health().is_up);
}

TEST_F(SerialPortTest, LeftoverSettingsOfAnotherProgramAreCleared) {
  termios left{};
  const int fd = open(name_.c_str(), O_RDWR | O_NOCTTY);
  ASSERT_EQ(tcgetattr(fd, &left), 0);
  left.c_lflag |= ECHO | ICANON | ISIG;
  left.c_iflag |= IXON | ICRNL | ISTRIP;
  left.c_oflag |= OPOST | ONLCR;
  ASSERT_EQ(tcsetattr(fd, TCSANOW, &left), 0);
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port) << port.error().text();
  termios now{};
  ASSERT_EQ(tcgetattr(fd, &now), 0);
  EXPECT_EQ(now.c_lflag & (ECHO | ICANON | ISIG), 0U);
  EXPECT_EQ(now.c_iflag & (IXON | ICRNL | ISTRIP), 0U);
  EXPECT_EQ(now.c_oflag & OPOST, 0U);
  EXPECT_EQ(now.c_cflag & HUPCL, 0U);
  EXPECT_NE(now.c_cflag & CLOCAL, 0U);
  close(fd);
}

TEST_F(SerialPortTest, ClosingLetsTheNextOneIn) {
  { auto port = SerialPort::open(settings_); }
  EXPECT_TRUE(SerialPort::open(settings_));
}

TEST_F(SerialPortTest, UnplugIsNoticedAndTheSameNameOpensTheNewDevice) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  device_.unplug();
  ASSERT_TRUE(becomes_readable(port->fd()));
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_EQ(port->read(buffer).status, IoStatus::kGone);
  EXPECT_EQ(port->write(buffer).status, IoStatus::kGone);

  PluggedDevice again(name_);
  auto reopened = SerialPort::open(settings_);
  ASSERT_TRUE(reopened) << reopened.error().text();
  const int unplugged = port->fd();
  port = std::move(reopened);
  EXPECT_EQ(fcntl(unplugged, F_GETFD), -1) << "the old one is closed, so that its name comes free";
  ASSERT_EQ(write(again.near_end(), "x", 1), 1);
  ASSERT_TRUE(becomes_readable(port->fd()));
  EXPECT_EQ(port->read(buffer).n, 1U);
}

TEST_F(SerialPortTest, AStaleNameOfAnUnpluggedDeviceSaysToPlugItIn) {
  device_.unplug();
  const auto port = SerialPort::open(settings_);
  ASSERT_FALSE(port);
  EXPECT_NE(port.error().remedy.find("plug the device in"), std::string::npos) << port.error().text();
}

TEST_F(SerialPortTest, WhatCameBeforeOpeningIsThrownAway) {
  ASSERT_EQ(write(device_.near_end(), "old", 3), 3);
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_EQ(port->read(buffer).status, IoStatus::kNothing);
}

TEST_F(SerialPortTest, AFullLineIsNotTheEnd) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  const std::vector<std::uint8_t> block(4096);
  IoResult result{IoStatus::kDone, 0};
  for (int i = 0; i < 1000 && result.status == IoStatus::kDone; ++i) result = port->write(block);
  EXPECT_EQ(result.status, IoStatus::kNothing);
}

TEST(SerialPort, AMissingPortNamesThoseThatAreThere) {
  const auto folder = test::scratch_folder();
  std::ofstream(folder / "ttyMT7").put('x');
  const auto port = SerialPort::open({(folder / "ttyMT3").string(), 115200, 1});
  ASSERT_FALSE(port);
  EXPECT_NE(port.error().what.find("ttyMT3 does not exist"), std::string::npos);
  EXPECT_NE(port.error().remedy.find("ttyMT7"), std::string::npos) << port.error().remedy;
}

TEST(SerialPort, AFileIsNotASerialPort) {
  const auto file = test::scratch_folder() / "notes.txt";
  std::ofstream(file).put('x');
  const auto port = SerialPort::open({file.string(), 115200, 1});
  ASSERT_FALSE(port);
  EXPECT_NE(port.error().what.find("is not a serial port"), std::string::npos) << port.error().what;
}

TEST(SerialPort, ANonsenseLineIsAUsageError) {
  EXPECT_EQ(SerialPort::open({"/dev/null", 0, 1}).error().kind, ErrorKind::kUsage);
  EXPECT_EQ(SerialPort::open({"/dev/null", 9600, 3}).error().kind, ErrorKind::kUsage);
}

}  // namespace
}  // namespace imuscope
