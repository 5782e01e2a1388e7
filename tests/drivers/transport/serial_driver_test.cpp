/// Serial ports whose driver does what a pseudo-terminal's does not: rounds baud rates, refuses settings,
/// counts errors. It is a pseudo-terminal of which some requests are answered here.

#include "drivers/transport/serial_port.h"

// Not <termios.h>, which does not go together with the kernel's termios2.
#include <asm/termbits.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <vector>

#include "tests/support/refused_calls.h"

namespace imuscope {
namespace {

using testing::AllOf;
using testing::HasSubstr;

using Answer = std::function<int(int fd, unsigned long request, void* argument)>;

/// Answers the requests of this thread; kAsk leaves one to the kernel.
thread_local Answer driver;
constexpr int kAsk = -1000;

int ask_kernel(int fd, unsigned long request, void* argument) {
  return static_cast<int>(syscall(SYS_ioctl, fd, request, argument));
}

int refused(int error) {
  errno = error;
  return -1;
}

}  // namespace
}  // namespace imuscope

// In place of that of the C library, for the whole program.
extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  if (imuscope::driver) {
    const int answer = imuscope::driver(fd, request, argument);
    if (answer != imuscope::kAsk) return answer;
  }
  return imuscope::ask_kernel(fd, request, argument);
}

namespace imuscope {
namespace {

class SerialDriver : public testing::Test {
 protected:
  void SetUp() override {
    near_end_ = posix_openpt(O_RDWR | O_NOCTTY);
    ASSERT_GE(near_end_, 0);
    ASSERT_EQ(grantpt(near_end_), 0);
    ASSERT_EQ(unlockpt(near_end_), 0);
    settings_.path = ptsname(near_end_);
  }
  void TearDown() override {
    driver = nullptr;
    close(near_end_);
  }
  /// The error of a port that does not open.
  [[nodiscard]] Error error_of_opening() const {
    const auto port = SerialPort::open(settings_);
    EXPECT_FALSE(port);
    return port ? Error{} : port.error();
  }
  /// After the kernel has read the line's settings out, they are changed as the driver would have them.
  static void let_settings_be(const std::function<void(termios2&)>& change) {
    driver = [change](int fd, unsigned long request, void* argument) {
      const int answer = request == TCGETS2 ? ask_kernel(fd, request, argument) : kAsk;
      if (answer == 0) change(*static_cast<termios2*>(argument));
      return answer;
    };
  }

  int near_end_ = -1;
  SerialSettings settings_{"", 921'600, 1};
};

TEST_F(SerialDriver, ABaudRateThatIsMissedByMoreThanAUartEnduresIsRefusedWithWhatItWouldBe) {
  let_settings_be([](termios2& line) { line.c_ospeed = 900'000; });
  EXPECT_THAT(error_of_opening().text(),
              AllOf(HasSubstr(settings_.path + " runs at 900000 baud instead of 921600"),
                    HasSubstr("choose a baud rate")));
  // 1.5 % off: bytes come through, and the port tells the real rate.
  let_settings_be([](termios2& line) { line.c_ospeed = 907'776; });
  const auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port) << port.error().text();
  EXPECT_EQ(port->baud(), 907'776.0);
  EXPECT_EQ(port->timing().per_byte, from_seconds(10.0 / 907'776.0)) << "not the rate that was asked for";
  EXPECT_THAT(port->describe(), HasSubstr("at 907776 baud"));
}

TEST_F(SerialDriver, ALineThatIsNotAsAskedForIsRefused) {
  const std::vector<std::function<void(termios2&)>> others{
      [](termios2& line) { line.c_cflag ^= CSTOPB; }, [](termios2& line) { line.c_cflag |= PARENB; },
      [](termios2& line) { line.c_cflag = (line.c_cflag & ~CSIZE) | CS7; },
      [](termios2& line) { line.c_cflag |= CRTSCTS; }, [](termios2& line) { line.c_lflag |= ECHO; }};
  for (const int stop_bits : {1, 2}) {
    settings_.stop_bits = stop_bits;
    for (const auto& change : others) {
      let_settings_be(change);
      const Error error = error_of_opening();
      EXPECT_THAT(error.what, HasSubstr("does not take 8 data bits, no parity, " + std::to_string(stop_bits) +
                                        " stop bits"));
      EXPECT_FALSE(error.remedy.empty());
    }
  }
}

TEST_F(SerialDriver, SettingsThatTheDriverRefusesAreNamed) {
  driver = [](int, unsigned long request, void*) { return request == TCSETS2 ? refused(EINVAL) : kAsk; };
  EXPECT_THAT(error_of_opening().text(),
              AllOf(HasSubstr("cannot be set to 921600 baud, 8 bits, no parity, 1 stop bits"),
                    HasSubstr(std::strerror(EINVAL)), HasSubstr("choose a baud rate")));
}

TEST_F(SerialDriver, APortThatIsUnpluggedWhileItIsSetUpSaysSo) {
  bool is_set = false;
  driver = [&](int, unsigned long request, void*) {
    if (request == TCSETS2) is_set = true;
    return request == TCGETS2 && is_set ? refused(EIO) : kAsk;
  };
  const Error error = error_of_opening();
  EXPECT_THAT(error.what, HasSubstr("vanished while it was set up"));
  EXPECT_THAT(error.remedy, HasSubstr("plug the device in again"));
}

TEST_F(SerialDriver, BytesAreAskedForAtOnceAndNothingElseOfTheDriverIsChanged) {
  serial_struct set{};
  driver = [&](int, unsigned long request, void* argument) {
    if (request != TIOCGSERIAL && request != TIOCSSERIAL) return kAsk;
    if (request == TIOCSSERIAL) {
      set = *static_cast<serial_struct*>(argument);
      return 0;
    }
    auto& now = *static_cast<serial_struct*>(argument);
    now = {};
    now.flags = ASYNC_SPD_CUST;
    now.custom_divisor = 7;
    return 0;
  };
  const auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  EXPECT_TRUE(port->low_latency());
  EXPECT_EQ(set.flags, ASYNC_SPD_CUST | ASYNC_LOW_LATENCY);
  EXPECT_EQ(set.custom_divisor, 7);
}

TEST_F(SerialDriver, ADriverThatHoldsBytesBackAllTheSameIsNoReasonToFail) {
  driver = [](int, unsigned long request, void* argument) {
    if (request == TIOCGSERIAL) std::memset(argument, 0, sizeof(serial_struct));
    return request == TIOCGSERIAL ? 0 : request == TIOCSSERIAL ? refused(EPERM) : kAsk;
  };
  const auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  EXPECT_FALSE(port->low_latency());
}

TEST_F(SerialDriver, BytesThatWereOverrunSinceThePortWasOpenedAreCountedAsLost) {
  serial_icounter_struct counts{};
  counts.overrun = 100;
  counts.buf_overrun = 20;
  driver = [&](int, unsigned long request, void* argument) {
    if (request != TIOCGICOUNT) return kAsk;
    *static_cast<serial_icounter_struct*>(argument) = counts;
    return 0;
  };
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  EXPECT_EQ(port->health().frames_dropped, 0U) << "what was lost before was not ours";
  counts.overrun += 3;
  counts.buf_overrun += 4;
  counts.frame = 5;
  counts.parity = 6;
  counts.brk = 7;
  EXPECT_EQ(port->health().frames_dropped, 7U);
  const auto errors = port->line_errors();
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->overrun, 103);
  EXPECT_EQ(errors->buffer_overrun, 24);
  EXPECT_EQ(errors->frame, 5);
  EXPECT_EQ(errors->parity, 6);
  EXPECT_EQ(errors->break_marks, 7);
  // A driver that was loaded anew counts from nothing.
  counts = {};
  EXPECT_EQ(port->health().frames_dropped, 0U);
}

TEST_F(SerialDriver, ASignalIsNoEndAndWhatAVanishedDeviceSaysIs) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  std::vector<std::uint8_t> buffer(10);
  ASSERT_EQ(::write(near_end_, "hello", 5), 5);
  {
    const test::RefusedCalls interrupted(test::Call::kRead, EINTR, 2);
    EXPECT_EQ(port->read(buffer).n, 5U);
    EXPECT_EQ(interrupted.left(), 0);
  }
  {
    const test::RefusedCalls interrupted(test::Call::kWrite, EINTR, 2);
    EXPECT_EQ(port->write(buffer).n, 10U);
    EXPECT_EQ(interrupted.left(), 0);
  }
  const struct {
    int error;
    IoStatus status;
  } cases[] = {{EIO, IoStatus::kGone},   {ENXIO, IoStatus::kGone},     {ENODEV, IoStatus::kGone},
               {EBADF, IoStatus::kGone}, {EAGAIN, IoStatus::kNothing}, {ENOMEM, IoStatus::kNothing}};
  for (const auto& [error, status] : cases) {
    const test::RefusedCalls no_read(test::Call::kRead, error);
    EXPECT_EQ(port->read(buffer).status, status) << std::strerror(error);
    const test::RefusedCalls no_write(test::Call::kWrite, error);
    EXPECT_EQ(port->write(buffer).status, status) << std::strerror(error);
  }
  EXPECT_EQ(port->write({}).status, IoStatus::kNothing);
}

TEST_F(SerialDriver, APortThatIsGivenItselfStaysOpen) {
  auto port = SerialPort::open(settings_);
  ASSERT_TRUE(port);
  SerialPort& same = *port;
  *port = std::move(same);
  EXPECT_GE(port->fd(), 0);
  const std::vector<std::uint8_t> byte{1};
  EXPECT_EQ(port->write(byte).n, 1U);
}

}  // namespace
}  // namespace imuscope
