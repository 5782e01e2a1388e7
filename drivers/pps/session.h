#pragma once

/// The session of a PPS device: it only pulses, and says what is wrong where it does not.

#include "drivers/device/listening_session.h"

namespace imuscope::pps {

class Session final : public ListeningSession {
 public:
  Session() noexcept;

 private:
  [[nodiscard]] bool hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  [[nodiscard]] std::string_view nothing_comes() const noexcept override;
  [[nodiscard]] std::string_view nothing_is_understood() const noexcept override;
};

}  // namespace imuscope::pps
