#include "service/live/controlling_terminal.h"

#include <fcntl.h>
#include <unistd.h>

namespace imuscope {

namespace {

/// The name that each process has for its own (tty(4)).
bool can_be_reached() {
  const int fd = ::open("/dev/tty", O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return false;
  ::close(fd);
  return true;
}

}  // namespace

ControllingTerminal::ControllingTerminal() : was_there_(can_be_reached()) {}

bool ControllingTerminal::is_gone() const { return was_there_ && !can_be_reached(); }

}  // namespace imuscope
