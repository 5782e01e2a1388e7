#pragma once

/// What an XSens device hears: commands out of the bytes on its receive line, and the codes of its baud
/// rates.

#include <cstdint>
#include <span>

#include "firmware_sim/devices/bytes.h"

namespace imusim::xsens {

struct Command {
  std::uint8_t bid = 0xFF;
  std::uint8_t mid = 0;
  Bytes data;

  /// Whether the device with this bus id is meant: by its own id, as the head of the line, or as one of all.
  [[nodiscard]] bool is_for(std::uint8_t bus_id) const {
    constexpr std::uint8_t kHead = 0xFF;
    constexpr std::uint8_t kBroadcast = 0x00;
    return bid == kHead || bid == kBroadcast || bid == bus_id;
  }
};

/// Finds commands in a stream; skips one byte where a preamble was none.
class CommandScanner {
 public:
  void hear(std::span<const std::uint8_t> bytes) { put_bytes(heard_, bytes); }
  /// Takes the next whole command.
  bool next(Command& command);

 private:
  Bytes heard_;
};

/// 0 for a code that no device knows.
int baud_of_code(std::uint8_t code);
/// That of 115200 baud for a rate that has no code.
std::uint8_t code_of_baud(int baud);

}  // namespace imusim::xsens
