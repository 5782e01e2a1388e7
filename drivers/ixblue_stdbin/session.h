#pragma once

/// A StdBin unit only sends: its session waits for good telegrams and says what is wrong while there are
/// none.

#include <cstdint>

#include "drivers/device/device.h"
#include "drivers/ixblue_stdbin/scanner.h"

namespace imuscope::ixblue_stdbin {

class Session final : public DeviceSession {
 public:
  void on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  /// Always empty: the unit is set up with its own tools.
  [[nodiscard]] std::span<const std::uint8_t> poll(HostTime now) noexcept override;
  [[nodiscard]] SessionState state() const noexcept override { return state_; }
  [[nodiscard]] std::string_view problem() const noexcept override { return problem_; }

 private:
  Scanner scanner_;
  SessionState state_ = SessionState::kConnecting;
  std::string_view problem_;
  bool started_ = false;
  HostTime last_good_{};  ///< or begin of the session
  std::uint64_t bytes_since_good_ = 0;
};

}  // namespace imuscope::ixblue_stdbin
