#pragma once

/// A StdBin unit only sends: its session waits for good telegrams. The unit is set up with its own tools.

#include "drivers/device/listening_session.h"
#include "drivers/ixblue_stdbin/scanner.h"

namespace imuscope::ixblue_stdbin {

class Session final : public ListeningSession {
 public:
  Session() noexcept;

 private:
  [[nodiscard]] bool hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  [[nodiscard]] std::string_view nothing_comes() const noexcept override;
  [[nodiscard]] std::string_view nothing_is_understood() const noexcept override;

  Scanner scanner_;
};

}  // namespace imuscope::ixblue_stdbin
