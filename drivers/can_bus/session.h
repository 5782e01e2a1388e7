#pragma once

/// The session of a device on a CAN bus: it only listens. The device streams while its frames come; what the
/// error frames say of the bus becomes the problem.

#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/can_bus/error_frame.h"
#include "drivers/device/device.h"
#include "drivers/device/sentence.h"

namespace imuscope {

class CanSession final : public DeviceSession {
 public:
  /// Without a frame for so long the device no longer streams: its last word is never held.
  static constexpr Duration kSilence = std::chrono::seconds(1);

  void on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  /// Never has anything to say.
  [[nodiscard]] std::span<const std::uint8_t> poll(HostTime now) noexcept override;
  [[nodiscard]] SessionState state() const noexcept override { return state_; }
  [[nodiscard]] std::string_view problem() const noexcept override { return problem_.view(); }

  [[nodiscard]] CanBusState bus_state() const noexcept { return bus_state_; }
  [[nodiscard]] std::uint64_t error_frames() const noexcept { return error_frames_; }
  /// How often the controller had no room for a frame.
  [[nodiscard]] std::uint64_t overflows() const noexcept { return overflows_; }

 private:
  void on_error(const CanFrame& frame, HostTime now) noexcept;
  void tell() noexcept;

  SessionState state_ = SessionState::kConnecting;
  CanBusState bus_state_ = CanBusState::kActive;
  HostTime last_frame_{HostTime::min()};
  bool errors_alone_ = false;  ///< error frames came since the last other frame
  bool overflowed_ = false;
  HostTime last_overflow_{HostTime::min()};
  std::uint64_t error_frames_ = 0;
  std::uint64_t bus_offs_ = 0;
  std::uint64_t overflows_ = 0;
  Sentence problem_;
};

}  // namespace imuscope
