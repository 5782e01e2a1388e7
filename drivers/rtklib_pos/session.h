#pragma once

/// Solutions of RTKLIB only come: the session waits for lines that are such, in the format that the last
/// header told.

#include <optional>

#include "drivers/device/listening_session.h"
#include "drivers/rtklib_pos/messages.h"
#include "drivers/rtklib_pos/scanner.h"

namespace imuscope::rtklib_pos {

class Session final : public ListeningSession {
 public:
  Session() noexcept;

 private:
  [[nodiscard]] bool hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  [[nodiscard]] std::string_view nothing_comes() const noexcept override;
  [[nodiscard]] std::string_view nothing_is_understood() const noexcept override;

  Scanner scanner_;
  Format format_;
  std::optional<ReferencePosition> base_;
};

}  // namespace imuscope::rtklib_pos
