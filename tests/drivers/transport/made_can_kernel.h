#pragma once

/// A kernel with one CAN interface that this program makes up: what netlink says of it, what its sockets bring, and what
/// was asked of it. It stands in for calls of the C library in the whole program.

#include <linux/can.h>

#include <cstdint>
#include <string>
#include <vector>

namespace imuscope::test {

/// One message that recvmmsg() brings.
struct MadeFrame {
  canfd_frame frame{};
  unsigned n_bytes = CAN_MTU;
  std::vector<std::uint8_t> control;  ///< whole control messages
};

struct MadeCanKernel {
  int socket_error = 0;              ///< of CAN sockets
  int netlink_error = 0;             ///< of netlink sockets
  std::vector<std::uint8_t> answer;  ///< of netlink
  int receive_error = 0;             ///< of recv() and recvmmsg()
  int interrupted = 0;               ///< calls of recvmmsg() that a signal ends
  std::vector<MadeFrame> frames;     ///< that wait
  int option_that_fails = -1;        ///< of SOL_CAN_RAW
  int bind_error = 0;
  short interface_flags = 0;  ///< as SIOCGIFFLAGS says
  int flags_error = 0;
  std::string said;                 ///< of each call, a line
  std::vector<std::uint8_t> asked;  ///< of netlink, the last request
};
MadeCanKernel& made_can_kernel();

}  // namespace imuscope::test
