#include "drivers/xsens_mt/messages.h"

#include <algorithm>

#include "base/bytes.h"
#include "base/contracts.h"

namespace imuscope::xsens {
namespace {

// Offsets in a Configuration message.
constexpr std::size_t kConfigurationFixed = 98;
constexpr std::size_t kConfigurationPerDevice = 20;
constexpr std::size_t kDateOffset = 16;
constexpr std::size_t kTimeOffset = 24;
constexpr std::size_t kDeviceCountOffset = 96;

struct MessageName {
  std::uint8_t mid;
  std::string_view name;
};
constexpr auto kMessageNames = std::to_array<MessageName>({
    {0x00, "ReqDID"},
    {0x01, "DeviceID"},
    {0x02, "InitBus"},
    {0x03, "InitBusResults"},
    {0x04, "SetPeriod"},
    {0x05, "SetPeriodAck"},
    {0x06, "SetBID"},
    {0x07, "SetBIDAck"},
    {0x08, "BusPwr"},
    {0x0A, "ReqDataLength"},
    {0x0B, "DataLength"},
    {0x0C, "ReqConfiguration"},
    {0x0D, "Configuration"},
    {0x0E, "RestoreFactoryDef"},
    {0x0F, "RestoreFactoryDefAck"},
    {0x10, "GoToMeasurement"},
    {0x11, "GoToMeasurementAck"},
    {0x12, "ReqFWRev"},
    {0x13, "FirmwareRev"},
    {0x14, "DisableBT"},
    {0x16, "SetOpMode"},
    {0x18, "SetBaudrate"},
    {0x19, "SetBaudrateAck"},
    {0x1A, "SetSyncMode"},
    {0x1C, "ReqProductCode"},
    {0x1D, "ProductCode"},
    {0x1E, "ReqHardwareVersion"},
    {0x1F, "HardwareVersion"},
    {0x20, "SetProcessingFlags"},
    {0x21, "SetProcessingFlagsAck"},
    {0x22, "SetNoRotation"},
    {0x23, "SetNoRotationAck"},
    {0x24, "RunSelftest"},
    {0x25, "SelftestResults"},
    {0x2C, "SetSyncSettings"},
    {0x2D, "SetSyncSettingsAck"},
    {0x30, "GoToConfig"},
    {0x31, "GoToConfigAck"},
    {0x32, "MTData"},
    {0x34, "ReqData"},
    {0x36, "MTData2"},
    {0x3E, "WakeUp"},
    {0x3F, "WakeUpAck"},
    {0x40, "Reset"},
    {0x41, "ResetAck"},
    {0x42, "Error"},
    {0x44, "XmPowerOff"},
    {0x48, "SetOptionFlags"},
    {0x49, "SetOptionFlagsAck"},
    {0x60, "ReqUTCTime"},
    {0x61, "UTCTime"},
    {0x62, "ReqAvailableFilterProfiles"},
    {0x63, "AvailableFilterProfiles"},
    {0x64, "SetFilterProfile"},
    {0x65, "SetFilterProfileAck"},
    {0x66, "SetGravityMagnitude"},
    {0x67, "SetGravityMagnitudeAck"},
    {0x68, "SetLeverArm"},
    {0x69, "SetLeverArmAck"},
    {0x6A, "SetMagneticDeclination"},
    {0x6B, "SetMagneticDeclinationAck"},
    {0x6E, "SetLatLonAlt"},
    {0x6F, "SetLatLonAltAck"},
    {0x74, "IccCommand"},
    {0x75, "IccCommandAck"},
    {0x76, "SetGnssPlatform"},
    {0x77, "SetGnssPlatformAck"},
    {0x82, "SetHeading"},
    {0x83, "SetHeadingAck"},
    {0x84, "SetLocationID"},
    {0x85, "SetLocationIDAck"},
    {0x86, "SetExtOutputMode"},
    {0x87, "SetExtOutputModeAck"},
    {0x88, "ReqBatteryLevel"},
    {0x89, "BatteryLevel"},
    {0x8C, "SetPortConfig"},
    {0x8D, "SetPortConfigAck"},
    {0x8E, "SetStringOutputType"},
    {0x8F, "SetStringOutputTypeAck"},
    {0x90, "ReqEMTS"},
    {0x91, "EMTS"},
    {0xA4, "ResetOrientation"},
    {0xA5, "ResetOrientationAck"},
    {0xA8, "AdjustUTCTime"},
    {0xA9, "AdjustUTCTimeAck"},
    {0xC0, "SetOutputConfiguration"},
    {0xC1, "OutputConfiguration"},
    {0xD0, "SetOutputMode"},
    {0xD1, "SetOutputModeAck"},
    {0xD2, "SetOutputSettings"},
    {0xD3, "SetOutputSettingsAck"},
    {0xD4, "SetOutputSkipFactor"},
    {0xD5, "SetOutputSkipFactorAck"},
    {0xD6, "SetSyncInSettings"},
    {0xD7, "SetSyncInSettingsAck"},
    {0xD8, "SetSyncOutSettings"},
    {0xD9, "SetSyncOutSettingsAck"},
    {0xDA, "SetErrorMode"},
    {0xDB, "SetErrorModeAck"},
    {0xDC, "SetTransmitDelay"},
    {0xDD, "SetTransmitDelayAck"},
    {0xE0, "SetObjectAlignment"},
    {0xE1, "SetObjectAlignmentAck"},
    {0xE6, "SetCanConfig"},
    {0xE7, "SetCanConfigAck"},
    {0xE8, "SetCanOutputConfig"},
    {0xE9, "SetCanOutputConfigAck"},
    {0xEC, "SetAlignmentRotation"},
    {0xED, "SetAlignmentRotationAck"},
});

struct ErrorName {
  std::uint8_t code;
  std::string_view text;
};
constexpr auto kErrorNames = std::to_array<ErrorName>({
    {0x01, "no communication on the Xbus; check the bus cable"},
    {0x02, "Xbus not ready"},
    {0x03, "period out of range; ask for a lower rate"},
    {0x04, "message invalid"},
    {0x10, "InitBus failed"},
    {0x11, "InitBus failed"},
    {0x12, "InitBus failed"},
    {0x14, "SetBID failed"},
    {0x15, "SetBID failed"},
    {0x18, "measurement did not start"},
    {0x19, "measurement did not start"},
    {0x1A, "measurement did not start: the data of all devices is too long for this firmware"},
    {0x1B, "measurement did not start"},
    {0x1C, "measurement did not start"},
    {0x1D, "measurement did not start"},
    {0x1E, "timer overflow: the output is slower than wanted; lower the rate or send less"},
    {0x20, "baud rate invalid"},
    {0x21, "parameter invalid"},
    {0x23, "transmit buffer full"},
    {0x24, "overflow"},
    {0x28, "device error; power it off and on"},
    {0x29, "data overflow: the output does not fit the baud rate; raise the baud rate or send less"},
    {0x2A, "buffer full"},
    {0x2B, "external trigger"},
    {0x2C, "sample order"},
    {0x2D, "power dip; check the supply"},
    {0x2E, "current limiter; check the supply"},
    {0x2F, "temperature out of range"},
    {0x30, "battery low"},
    {0x31, "filter profile invalid"},
    {0x32, "settings invalid"},
    {0x33, "control denied: another program controls the device"},
});

}  // namespace

OutgoingFrame::OutgoingFrame(std::uint8_t bid, std::uint8_t mid,
                             std::span<const std::uint8_t> data) noexcept {
  IMUSCOPE_EXPECTS(data.size() <= kDataMaxOut);
  bytes_[0] = kPreamble;
  bytes_[1] = bid;
  bytes_[2] = mid;
  bytes_[3] = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), bytes_.begin() + kHeaderSize);
  size_ = kHeaderSize + data.size() + kChecksumSize;
  std::uint8_t sum = 0;
  for (std::size_t i = 1; i + 1 < size_; ++i) sum = static_cast<std::uint8_t>(sum + bytes_[i]);
  bytes_[size_ - 1] = static_cast<std::uint8_t>(0U - sum);
}

std::optional<Configuration> read_configuration(std::span<const std::uint8_t> data) noexcept {
  if (data.size() < kConfigurationFixed) return std::nullopt;
  Configuration c;
  c.n_devices = read_be<std::uint16_t>(data, kDeviceCountOffset);
  if (c.n_devices > kBusDevicesMax) return std::nullopt;
  if (data.size() < kConfigurationFixed + c.n_devices * kConfigurationPerDevice) return std::nullopt;
  c.master_id = read_be<std::uint32_t>(data, 0);
  c.period = read_be<std::uint16_t>(data, 4);
  c.skip_factor = read_be<std::uint16_t>(data, 6);
  c.sync_in_mode = read_be<std::uint16_t>(data, 8);
  c.sync_in_skip = read_be<std::uint16_t>(data, 10);
  c.sync_in_offset = read_be<std::uint32_t>(data, 12);
  std::copy_n(data.begin() + kDateOffset, c.date.size(), c.date.begin());
  std::copy_n(data.begin() + kTimeOffset, c.time.size(), c.time.begin());
  for (std::size_t k = 0; k < c.n_devices; ++k) {
    const auto record =
        data.subspan(kConfigurationFixed + k * kConfigurationPerDevice, kConfigurationPerDevice);
    DeviceRecord& d = c.devices[k];
    d.device_id = read_be<std::uint32_t>(record, 0);
    d.data_length = read_be<std::uint16_t>(record, 4);
    d.output_mode = read_be<std::uint16_t>(record, 6);
    d.output_settings = read_be<std::uint32_t>(record, 8);
    d.scenario = read_be<std::uint16_t>(record, 12);
    std::copy_n(record.begin() + 14, d.firmware.size(), d.firmware.begin());
  }
  return c;
}

std::string_view error_text(std::uint8_t code) noexcept {
  const auto* found = std::find_if(kErrorNames.begin(), kErrorNames.end(),
                                   [code](const ErrorName& entry) { return entry.code == code; });
  return found == kErrorNames.end() ? std::string_view{"unknown error"} : found->text;
}

std::string_view message_name(std::uint8_t mid) noexcept {
  const auto* found = std::find_if(kMessageNames.begin(), kMessageNames.end(),
                                   [mid](const MessageName& entry) { return entry.mid == mid; });
  return found == kMessageNames.end() ? std::string_view{} : found->name;
}

}  // namespace imuscope::xsens
