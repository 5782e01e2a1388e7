#pragma once

/// Control messages of the XSens MT protocol: building frames to a device, and reading what it answers.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/xsens_mt/wire.h"

namespace imuscope::xsens {

/// A frame to be written, in storage of its own. Holds the longest message that is ever sent to a device
/// (an output configuration of 32 items).
class OutgoingFrame {
 public:
  OutgoingFrame() = default;
  /// @param data  at most kDataMaxOut bytes
  OutgoingFrame(std::uint8_t bid, std::uint8_t mid, std::span<const std::uint8_t> data = {}) noexcept;

  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return {bytes_.data(), size_}; }

  static constexpr std::size_t kDataMaxOut = 32 * 4;

 private:
  std::array<std::uint8_t, kHeaderSize + kDataMaxOut + kChecksumSize> bytes_{};
  std::size_t size_ = 0;
};

/// Most significant byte first, as message data.
constexpr std::array<std::uint8_t, 2> be16(std::uint16_t value) {
  return {static_cast<std::uint8_t>(value >> 8U), static_cast<std::uint8_t>(value)};
}
constexpr std::array<std::uint8_t, 4> be32(std::uint32_t value) {
  return {static_cast<std::uint8_t>(value >> 24U), static_cast<std::uint8_t>(value >> 16U),
          static_cast<std::uint8_t>(value >> 8U), static_cast<std::uint8_t>(value)};
}

/// One device's block in a Configuration message.
struct DeviceRecord {
  std::uint32_t device_id = 0;
  std::uint16_t data_length = 0;  ///< bytes of its block in MTData; 0 where it sends MTData2
  std::uint16_t output_mode = 0;
  std::uint32_t output_settings = 0;
  std::uint16_t scenario = 0;
  std::array<std::uint8_t, 3> firmware{};  ///< major, minor, revision
};

/// Configuration (0x0D): what the device will send in measurement.
struct Configuration {
  std::uint32_t master_id = 0;
  std::uint16_t period = 0;  ///< of sampling, 1/115200 s
  std::uint16_t skip_factor = 0;
  std::uint16_t sync_in_mode = 0;
  std::uint16_t sync_in_skip = 0;
  std::uint32_t sync_in_offset = 0;
  std::array<char, 8> date{};
  std::array<char, 8> time{};
  std::size_t n_devices = 0;
  std::array<DeviceRecord, kBusDevicesMax> devices{};

  /// Messages per second.
  [[nodiscard]] double rate_hz() const noexcept {
    return period == 0 ? 0.0 : kPeriodTicksPerSecond / (double{1.0} * period * (skip_factor + 1.0));
  }
  /// An Xbus Master speaks for the devices on its bus; a device on its own names itself.
  [[nodiscard]] bool is_xbus_master() const noexcept {
    return n_devices > 0 && master_id != devices[0].device_id;
  }
};

/// Nothing where the data is too short for the devices it announces, or announces more than a bus holds.
std::optional<Configuration> read_configuration(std::span<const std::uint8_t> data) noexcept;

/// What an Error message (0x42) says, in words with the remedy where there is one.
std::string_view error_text(std::uint8_t code) noexcept;

/// Name of a message id, such as "GoToConfig"; empty where it is not known.
std::string_view message_name(std::uint8_t mid) noexcept;

}  // namespace imuscope::xsens
