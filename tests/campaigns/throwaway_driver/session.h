#pragma once

/// A device that only sends: its session waits for its frames.

#include "drivers/device/listening_session.h"
#include "drivers/throwaway/scanner.h"

namespace imuscope::throwaway {

class Session final : public ListeningSession {
 public:
  Session() noexcept;

 private:
  [[nodiscard]] bool hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  [[nodiscard]] std::string_view nothing_comes() const noexcept override;
  [[nodiscard]] std::string_view nothing_is_understood() const noexcept override;

  Scanner scanner_;
};

}  // namespace imuscope::throwaway
