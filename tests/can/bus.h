#pragma once

/// Interfaces and peers for tests against a real CAN stack. Needs root and a kernel with vcan: tools/can_vm
/// gives both. The peers use the kernel and can-utils alone, nothing of imuscope's.

#include <linux/can.h>
#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace imuscope::test {

/// Runs a shell command; the test fails where the command does.
void shell(const std::string& command);
/// Its exit status.
int shell_status(const std::string& command);

/// A virtual CAN interface, up. Made where it is not there; it stays for the next test, since making one
/// takes a second on an emulated PC.
class Vcan {
 public:
  /// @param mtu  72 for CAN FD, 16 for classic CAN
  explicit Vcan(std::string name, int mtu = CANFD_MTU);
  void up() const { set_up(true); }
  void down() const { set_up(false); }
  void remove() const;

 private:
  void set_up(bool up) const;
  std::string name_;
};

/// Another node on the bus.
class Sender {
 public:
  explicit Sender(const std::string& interface);
  ~Sender();
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;
  /// @param id  with the kernel's flags
  void classic(canid_t id, const std::vector<std::uint8_t>& data, std::uint8_t raw_dlc = 0) const;
  void fd(canid_t id, const std::vector<std::uint8_t>& data, std::uint8_t flags = 0) const;

 private:
  void send(const void* frame, std::size_t n_bytes) const;
  int fd_ = -1;
};

/// A serial-line CAN adapter (LAWICEL protocol) made of software: the kernel's slcan driver talks to a
/// pseudo-terminal, whose far end says what a test wants an adapter to say.
class SerialLineAdapter {
 public:
  SerialLineAdapter();
  ~SerialLineAdapter();
  SerialLineAdapter(const SerialLineAdapter&) = delete;
  SerialLineAdapter& operator=(const SerialLineAdapter&) = delete;
  /// @param line  without its end, such as "t1232AABB", "sp130140"
  void say(const std::string& line) const;
  /// Pulls the adapter's plug.
  void unplug();
  [[nodiscard]] const std::string& interface() const { return interface_; }

 private:
  int adapter_ = -1;
  int line_ = -1;
  std::string interface_;
};

}  // namespace imuscope::test
