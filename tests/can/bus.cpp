#include "bus.h"

// Before the kernel's headers, which leave out what this one has defined.
#include <net/if.h>

#include <fcntl.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace imuscope::test {
namespace {

constexpr int kSlcanLineDiscipline = 17;  // N_SLCAN in <linux/tty.h>

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(what + ": " + std::strerror(errno));
}

ifreq request_for(const std::string& interface) {
  ifreq request{};
  std::memcpy(request.ifr_name, interface.data(), std::min(interface.size(), std::size_t{IFNAMSIZ - 1}));
  return request;
}

void ask(unsigned long what, ifreq& request) {
  const int fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  const int status = ioctl(fd, what, &request);
  ::close(fd);
  if (status != 0) fail(request.ifr_name);
}

}  // namespace

int shell_status(const std::string& command) {
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

void shell(const std::string& command) {
  if (const int status = shell_status(command); status != 0) {
    throw std::runtime_error("exit code " + std::to_string(status) + " of: " + command);
  }
}

Vcan::Vcan(std::string name, int mtu) : name_(std::move(name)) {
  if (if_nametoindex(name_.c_str()) == 0) shell("ip link add " + name_ + " type vcan");
  set_up(false);  // an interface in use keeps its kind
  ifreq request = request_for(name_);
  request.ifr_mtu = mtu;
  ask(SIOCSIFMTU, request);
  set_up(true);
}

void Vcan::set_up(bool up) const {
  ifreq request = request_for(name_);
  ask(SIOCGIFFLAGS, request);
  request.ifr_flags = static_cast<short>(up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP);
  ask(SIOCSIFFLAGS, request);
}

void Vcan::remove() const { shell("ip link del " + name_); }

Sender::Sender(const std::string& interface) : fd_(socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
  constexpr int kOptionFdFrames = 5;  // CAN_RAW_FD_FRAMES
  constexpr int kOn = 1;
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(interface.c_str()));
  if (fd_ < 0 || setsockopt(fd_, SOL_CAN_BASE + CAN_RAW, kOptionFdFrames, &kOn, sizeof kOn) != 0 ||
      bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    fail("no sender on " + interface);
  }
}

Sender::~Sender() { ::close(fd_); }

void Sender::send(const void* frame, std::size_t n_bytes) const {
  // A queue that is full empties at the speed of the bus.
  for (;;) {
    const auto n = ::write(fd_, frame, n_bytes);
    if (n == static_cast<ssize_t>(n_bytes)) return;
    if (errno != ENOBUFS) fail("a frame is not sent");
    usleep(1000);
  }
}

void Sender::classic(canid_t id, const std::vector<std::uint8_t>& data, std::uint8_t raw_dlc) const {
  can_frame frame{};
  frame.can_id = id;
  frame.len = static_cast<std::uint8_t>(data.size());
  frame.len8_dlc = raw_dlc;
  std::memcpy(frame.data, data.data(), std::min(data.size(), sizeof frame.data));
  send(&frame, sizeof frame);
}

void Sender::fd(canid_t id, const std::vector<std::uint8_t>& data, std::uint8_t flags) const {
  canfd_frame frame{};
  frame.can_id = id;
  frame.len = static_cast<std::uint8_t>(data.size());
  frame.flags = flags;
  std::memcpy(frame.data, data.data(), std::min(data.size(), sizeof frame.data));
  send(&frame, sizeof frame);
}

SerialLineAdapter::SerialLineAdapter() {
  termios raw{};
  cfmakeraw(&raw);
  if (openpty(&adapter_, &line_, nullptr, &raw, nullptr) != 0) fail("no pseudo-terminal");
  if (ioctl(line_, TIOCSETD, &kSlcanLineDiscipline) != 0) fail("no slcan line discipline");
  std::array<char, IFNAMSIZ> name{};
  if (ioctl(line_, SIOCGIFNAME, name.data()) != 0) fail("slcan has no interface");
  interface_ = name.data();
  shell("ip link set " + interface_ + " up");
}

SerialLineAdapter::~SerialLineAdapter() { unplug(); }

void SerialLineAdapter::say(const std::string& line) const {
  const std::string text = line + "\r";
  if (::write(adapter_, text.data(), text.size()) != static_cast<ssize_t>(text.size())) fail("adapter");
}

void SerialLineAdapter::unplug() {
  if (adapter_ >= 0) ::close(adapter_);
  if (line_ >= 0) ::close(line_);
  adapter_ = line_ = -1;
}

}  // namespace imuscope::test
