#pragma once

/// Finds frames in a byte stream. Core: bounded memory, no allocation, noexcept.

#include "drivers/device/scan_loop.h"
#include "drivers/throwaway/wire.h"

namespace imuscope::throwaway {

struct Frame {
  std::span<const std::uint8_t> bytes;  ///< valid until the next append()
  HostTime first_byte{};                ///< when its first byte arrived at the latest
};

class Scanner {
 public:
  explicit Scanner(Duration per_byte = Duration::zero()) noexcept : loop_(per_byte) {}

  [[nodiscard]] Duration per_byte() const noexcept { return loop_.per_byte(); }
  void set_per_byte(Duration per_byte) noexcept { loop_.set_per_byte(per_byte); }
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return loop_.append(bytes, arrival);
  }
  [[nodiscard]] bool next(Frame& frame, bool at_end = false) noexcept;
  [[nodiscard]] const ScanCounters& counters() const noexcept { return loop_.counters(); }

 private:
  ScanLoop<2 * kFrameSize> loop_;
};

}  // namespace imuscope::throwaway
