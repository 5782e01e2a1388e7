#include "drivers/transport/serial_port.h"

// termios2 (any baud rate) comes from the kernel's header, which does not go together with <termios.h>.
#include <asm/termbits.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

#include "drivers/device/frame_buffer.h"
#include "drivers/transport/port_problems.h"

namespace imuscope {
namespace {

constexpr double kBaudTolerance = 0.02;  // a UART still reads bytes at this error

/// Raw, 8 data bits, no parity, no flow control, nothing translated, no hang-up on close.
void make_raw(termios2& line, const SerialSettings& settings) {
  line.c_iflag = IGNBRK;
  line.c_oflag = 0;
  line.c_lflag = 0;
  line.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
  if (settings.stop_bits == 2) line.c_cflag |= CSTOPB;
  line.c_ispeed = settings.baud;
  line.c_ospeed = settings.baud;
  // With one byte as the minimum, no data is EAGAIN and 0 can only mean that the device is gone.
  line.c_cc[VMIN] = 1;
  line.c_cc[VTIME] = 0;
}

Result<double> set_line(int fd, const SerialSettings& settings) {
  termios2 line{};
  if (ioctl(fd, TCGETS2, &line) != 0) {
    return work_error(fmt::format("{} is not a serial port ({})", settings.path, std::strerror(errno)),
                      "give a tty, such as one of /dev/serial/by-id");
  }
  make_raw(line, settings);
  if (ioctl(fd, TCSETS2, &line) != 0) {
    return work_error(fmt::format("{} cannot be set to {} baud, 8 bits, no parity, {} stop bits ({})",
                                  settings.path, settings.baud, settings.stop_bits, std::strerror(errno)),
                      "choose a baud rate that the adapter offers");
  }
  // The call succeeds when anything was applied: what counts is what can be read back.
  termios2 real{};
  if (ioctl(fd, TCGETS2, &real) != 0)
    return work_error(fmt::format("{} vanished while it was set up", settings.path),
                      "plug the device in again");
  const double baud = real.c_ospeed;
  if (std::abs(baud / settings.baud - 1.0) > kBaudTolerance) {
    return work_error(fmt::format("{} runs at {} baud instead of {}", settings.path, baud, settings.baud),
                      "choose a baud rate that the adapter offers");
  }
  constexpr tcflag_t kFraming = CSIZE | CSTOPB | PARENB | CRTSCTS;
  if ((real.c_cflag & kFraming) != (line.c_cflag & kFraming) || real.c_lflag != 0) {
    return work_error(fmt::format("{} does not take 8 data bits, no parity, {} stop bits, raw", settings.path,
                                  settings.stop_bits),
                      "use another adapter");
  }
  return baud;
}

bool ask_for_low_latency(int fd) {
  serial_struct serial{};
  if (ioctl(fd, TIOCGSERIAL, &serial) != 0) return false;
  serial.flags |= ASYNC_LOW_LATENCY;
  return ioctl(fd, TIOCSSERIAL, &serial) == 0;
}

/// Low latency is this timer at its shortest, whatever it was set to before.
constexpr Duration kShortestTimer = std::chrono::milliseconds(1);

Duration held_for(const std::string& path, bool low_latency) {
  const auto timer_ms = latency_timer_ms(path);
  if (!timer_ms) return Duration::zero();
  const Duration timer = std::chrono::milliseconds(*timer_ms);
  return low_latency ? std::min(timer, kShortestTimer) : timer;
}

std::int64_t overruns(const std::optional<LineErrors>& errors) {
  return errors ? std::int64_t{errors->overrun} + errors->buffer_overrun : 0;
}

bool says_gone(int error) { return error == EIO || error == ENXIO || error == ENODEV || error == EBADF; }

}  // namespace

Result<SerialPort> SerialPort::open(const SerialSettings& settings) {
  if (settings.baud == 0 || settings.stop_bits < 1 || settings.stop_bits > 2) {
    return usage_error(fmt::format("{}: {} baud with {} stop bits is no serial line", settings.path,
                                   settings.baud, settings.stop_bits),
                       "give a baud rate above 0, and 1 or 2 stop bits");
  }
  // O_NONBLOCK: do not wait for a carrier. O_NOCTTY: a break must not end the program.
  const int fd = ::open(settings.path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return tl::unexpected<Error>(explain_open_failure(settings.path, errno));
  SerialPort port(settings.path, fd);
  // TIOCEXCL keeps others out, but not root; flock keeps out whoever asks.
  if (flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    return tl::unexpected<Error>(explain_open_failure(settings.path, EBUSY));
  }
  if (auto shared = shared_with_others(settings.path)) return tl::unexpected<Error>(std::move(*shared));
  auto baud = set_line(fd, settings);
  if (!baud) return tl::unexpected<Error>(std::move(baud.error()));
  port.baud_ = *baud;
  ioctl(fd, TIOCEXCL);
  port.low_latency_ = ask_for_low_latency(fd);
  port.timing_ = {byte_time(*baud, settings.stop_bits), held_for(settings.path, port.low_latency_)};
  ioctl(fd, TCFLSH, TCIOFLUSH);
  port.overruns_at_open_ = overruns(port.line_errors());
  return port;
}

SerialPort::SerialPort(SerialPort&& other) noexcept
    : Transport(std::move(other)),
      path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      baud_(other.baud_),
      timing_(other.timing_),
      low_latency_(other.low_latency_),
      overruns_at_open_(other.overruns_at_open_) {}

SerialPort& SerialPort::operator=(SerialPort&& other) noexcept {
  if (this == &other) return *this;
  close();
  path_ = std::move(other.path_);
  fd_ = std::exchange(other.fd_, -1);
  baud_ = other.baud_;
  timing_ = other.timing_;
  low_latency_ = other.low_latency_;
  overruns_at_open_ = other.overruns_at_open_;
  return *this;
}

SerialPort::~SerialPort() { close(); }

void SerialPort::close() noexcept {
  if (fd_ < 0) return;
  ioctl(fd_, TIOCNXCL);
  ::close(std::exchange(fd_, -1));
}

LineHealth SerialPort::health() noexcept {
  const std::int64_t dropped = overruns(line_errors()) - overruns_at_open_;
  return {true, static_cast<std::uint64_t>(std::max<std::int64_t>(dropped, 0))};
}

std::string SerialPort::describe() const {
  if (timing_.held <= kShortestTimer) return fmt::format("{} at {:.0f} baud", path_, baud_);
  return fmt::format("{} at {:.0f} baud (its adapter holds bytes for up to {} ms; {})", path_, baud_,
                     timing_.held / std::chrono::milliseconds(1), kLatencyRule);
}

IoResult SerialPort::read(std::span<std::uint8_t> buffer) noexcept {
  for (;;) {
    const ssize_t n = ::read(fd_, buffer.data(), buffer.size());
    if (n > 0) {
      const auto count = static_cast<std::size_t>(n);
      return {IoStatus::kDone, count, count == buffer.size()};
    }
    if (n == 0) return {IoStatus::kGone};
    if (errno == EINTR) continue;
    return {says_gone(errno) ? IoStatus::kGone : IoStatus::kNothing};
  }
}

IoResult SerialPort::write(std::span<const std::uint8_t> bytes) noexcept {
  for (;;) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n > 0) return {IoStatus::kDone, static_cast<std::size_t>(n)};
    if (n < 0 && errno == EINTR) continue;
    return {n < 0 && says_gone(errno) ? IoStatus::kGone : IoStatus::kNothing};
  }
}

std::optional<LineErrors> SerialPort::line_errors() const noexcept {
  serial_icounter_struct counts{};
  if (ioctl(fd_, TIOCGICOUNT, &counts) != 0) return std::nullopt;
  return LineErrors{counts.frame, counts.overrun, counts.parity, counts.brk, counts.buf_overrun};
}

}  // namespace imuscope
