#include "firmware_sim/devices/xsens_command.h"

#include <algorithm>
#include <array>

namespace imusim::xsens {
namespace {

// Longest message that a host sends: OutputConfiguration with 32 entries.
constexpr std::size_t kLongestCommand = 128;

// Index = baud code; 0x80 is another code of 921600.
constexpr std::array<int, 14> kBauds = {460800, 230400, 115200, 76800,  57600, 38400,   28800,
                                        19200,  14400,  9600,   921600, 4800,  2000000, 4000000};

}  // namespace

int baud_of_code(std::uint8_t code) {
  if (code == 0x80) return 921600;
  return code < kBauds.size() ? kBauds[code] : 0;
}

std::uint8_t code_of_baud(int baud) {
  const auto* const found = std::find(kBauds.begin(), kBauds.end(), baud);
  return static_cast<std::uint8_t>(found == kBauds.end() ? 2 : found - kBauds.begin());
}

bool CommandScanner::next(Command& command) {
  constexpr std::size_t kHeader = 4;
  while (true) {
    heard_.erase(heard_.begin(), std::find(heard_.begin(), heard_.end(), std::uint8_t{0xFA}));
    if (heard_.size() < kHeader) return false;
    const std::size_t length = heard_[3];
    const std::size_t whole = kHeader + length + 1;
    if (length <= kLongestCommand && heard_.size() < whole) return false;
    unsigned sum = 1;  // wrong, unless the sum below is right
    if (length <= kLongestCommand) {
      sum = 0;
      for (std::size_t i = 1; i < whole; ++i) sum += heard_[i];
    }
    if ((sum & 0xFFU) != 0) {
      heard_.erase(heard_.begin());
      continue;
    }
    const auto end = heard_.begin() + static_cast<std::ptrdiff_t>(whole);
    command = {heard_[1], heard_[2], Bytes(heard_.begin() + kHeader, end - 1)};
    heard_.erase(heard_.begin(), end);
    return true;
  }
}

}  // namespace imusim::xsens
