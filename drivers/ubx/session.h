#pragma once

/// A u-blox receiver that is set up beforehand: its session waits for NAV-PVT.

#include "drivers/device/listening_session.h"
#include "drivers/ubx/scanner.h"

namespace imuscope::ubx {

class Session final : public ListeningSession {
 public:
  Session() noexcept;

 private:
  [[nodiscard]] bool hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  [[nodiscard]] std::string_view nothing_comes() const noexcept override;
  [[nodiscard]] std::string_view nothing_is_understood() const noexcept override;

  Scanner scanner_;
};

}  // namespace imuscope::ubx
