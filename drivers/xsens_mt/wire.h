#pragma once

/// Constants of the XSens MT binary protocol (MTi, MTx, Xbus Master), as on the wire: most significant byte
/// first. Wire units live here; SI begins in the decoder.
///
/// Frame: preamble, bus id (BID), message id (MID), length, data, checksum. Length 255 announces a 16-bit
/// length in the next two bytes. The sum of all bytes after the preamble is 0 modulo 256.

#include <cstddef>
#include <cstdint>

namespace imuscope::xsens {

inline constexpr std::uint8_t kPreamble = 0xFA;
inline constexpr std::uint8_t kExtendedLength = 0xFF;
inline constexpr std::size_t kHeaderSize = 4;
inline constexpr std::size_t kExtendedHeaderSize = 6;
inline constexpr std::size_t kChecksumSize = 1;
/// Documented ceiling; what announces more is a false preamble.
inline constexpr std::size_t kDataMax = 2048;
inline constexpr std::size_t kFrameMax = kExtendedHeaderSize + kDataMax + kChecksumSize;

/// Bus ids: the only device or the Xbus head; devices on an Xbus count from 1.
inline constexpr std::uint8_t kMasterBid = 0xFF;
inline constexpr std::uint8_t kBusBidMax = 32;
inline constexpr std::size_t kBusDevicesMax = 10;

/// Message ids. The reply to a request is its id + 1; a message with data sets, without data asks.
namespace mid {
inline constexpr std::uint8_t kReqDid = 0x00;
inline constexpr std::uint8_t kDeviceId = 0x01;
inline constexpr std::uint8_t kPeriod = 0x04;
inline constexpr std::uint8_t kReqDataLength = 0x0A;
inline constexpr std::uint8_t kDataLength = 0x0B;
inline constexpr std::uint8_t kReqConfiguration = 0x0C;
inline constexpr std::uint8_t kConfiguration = 0x0D;
inline constexpr std::uint8_t kGoToMeasurement = 0x10;
inline constexpr std::uint8_t kReqFirmware = 0x12;
inline constexpr std::uint8_t kReqProductCode = 0x1C;
inline constexpr std::uint8_t kProductCode = 0x1D;
inline constexpr std::uint8_t kGoToConfig = 0x30;
inline constexpr std::uint8_t kMtData = 0x32;
inline constexpr std::uint8_t kMtData2 = 0x36;
inline constexpr std::uint8_t kWakeUp = 0x3E;
inline constexpr std::uint8_t kWakeUpAck = 0x3F;
inline constexpr std::uint8_t kReset = 0x40;
inline constexpr std::uint8_t kError = 0x42;
inline constexpr std::uint8_t kStringOutputType = 0x8E;
inline constexpr std::uint8_t kOutputConfiguration = 0xC0;
inline constexpr std::uint8_t kOutputMode = 0xD0;
inline constexpr std::uint8_t kOutputSettings = 0xD2;
inline constexpr std::uint8_t kOutputSkipFactor = 0xD4;
inline constexpr std::uint8_t kSyncInSettings = 0xD6;

constexpr std::uint8_t reply_to(std::uint8_t request) { return static_cast<std::uint8_t>(request + 1U); }
}  // namespace mid

/// OutputConfiguration: items of a data identifier and a rate in Hz, u16 each.
inline constexpr std::size_t kOutputItemSize = 4;
inline constexpr std::uint16_t kEveryMessage = 0xFFFF;  ///< in place of a rate; also: as fast as it can

/// SetPeriod counts in 1/115200 s: 1152 is 100 Hz.
inline constexpr double kPeriodTicksPerSecond = 115200.0;
/// The sample counter has 16 bits: it wraps every 655.36 s at 100 Hz.
inline constexpr std::int64_t kCounterModulus = 65536;
/// SampleTimeFine counts 100 us; it wraps at 2^32 (MTi-1, MTi-600) or after a day (MTi-10, MTi-100).
inline constexpr double kSampleTimeFinePerSecond = 10000.0;
inline constexpr std::int64_t kSampleTimeFineModulus = std::int64_t{1} << 32;
inline constexpr std::int64_t kSampleTimeFineDay = 864000000;

/// OutputMode: what a legacy MTData message holds.
namespace output_mode {
inline constexpr std::uint16_t kTemperature = 0x0001;
inline constexpr std::uint16_t kCalibrated = 0x0002;
inline constexpr std::uint16_t kOrientation = 0x0004;
inline constexpr std::uint16_t kAuxiliary = 0x0008;
inline constexpr std::uint16_t kPosition = 0x0010;
inline constexpr std::uint16_t kVelocity = 0x0020;
inline constexpr std::uint16_t kStatus = 0x0800;
inline constexpr std::uint16_t kGpsPvt = 0x1000;
inline constexpr std::uint16_t kRaw = 0x4000;  ///< excludes calibrated and orientation
}  // namespace output_mode

/// OutputSettings: how it holds it. The bits of acceleration, rate and field switch them off.
namespace output_settings {
inline constexpr std::uint32_t kSampleCounter = 0x1;
inline constexpr std::uint32_t kUtcTime = 0x2;
inline constexpr std::uint32_t kOrientationMask = 0xC;
inline constexpr std::uint32_t kQuaternion = 0x0;
inline constexpr std::uint32_t kEuler = 0x4;
inline constexpr std::uint32_t kMatrix = 0x8;
inline constexpr std::uint32_t kNoAcceleration = 0x10;
inline constexpr std::uint32_t kNoRate = 0x20;
inline constexpr std::uint32_t kNoField = 0x40;
inline constexpr std::uint32_t kFormatMask = 0x300;
inline constexpr std::uint32_t kFormatShift = 8;
inline constexpr std::uint32_t kNoAnalogue1 = 0x400;
inline constexpr std::uint32_t kNoAnalogue2 = 0x800;
/// Local frame of the orientation: north-east-down instead of north-west-up.
inline constexpr std::uint32_t kNorthEastDown = 0x80000000;
}  // namespace output_settings

/// How a real number is written; the two low bits of a data identifier and bits 8-9 of OutputSettings.
enum class NumberFormat : std::uint8_t { kFloat32 = 0, kFixed1220 = 1, kFixed1632 = 2, kFloat64 = 3 };

constexpr std::size_t size_of(NumberFormat format) {
  switch (format) {
    case NumberFormat::kFloat32:
    case NumberFormat::kFixed1220:
      return 4;
    case NumberFormat::kFixed1632:
      return 6;
    case NumberFormat::kFloat64:
      return 8;
  }
  return 0;
}

/// Data identifiers of MTData2 without their format bits (0-3).
namespace xdi {
inline constexpr std::uint16_t kFormatBits = 0x000F;
inline constexpr std::uint16_t kTemperature = 0x0810;
inline constexpr std::uint16_t kUtcTime = 0x1010;
inline constexpr std::uint16_t kPacketCounter = 0x1020;
inline constexpr std::uint16_t kSampleTimeFine = 0x1060;
inline constexpr std::uint16_t kQuaternion = 0x2010;
inline constexpr std::uint16_t kRotationMatrix = 0x2020;
inline constexpr std::uint16_t kEulerAngles = 0x2030;
inline constexpr std::uint16_t kDeltaV = 0x4010;
inline constexpr std::uint16_t kAcceleration = 0x4020;
inline constexpr std::uint16_t kAccelerationHr = 0x4040;
inline constexpr std::uint16_t kGnssPvt = 0x7010;
inline constexpr std::uint16_t kRateOfTurn = 0x8020;
inline constexpr std::uint16_t kDeltaQ = 0x8030;
inline constexpr std::uint16_t kRateOfTurnHr = 0x8040;
inline constexpr std::uint16_t kStatusByte = 0xE010;
inline constexpr std::uint16_t kStatusWord = 0xE020;
}  // namespace xdi

/// StatusWord, and the status byte of legacy data: the device's own filter has an orientation.
inline constexpr std::uint32_t kStatusFilterValid = 1U << 1U;
/// Status byte: the GPS receiver has a fix.
inline constexpr std::uint32_t kStatusGpsFix = 1U << 2U;
/// StatusWord: two bits, 0 none, 1 float, 2 fixed.
inline constexpr unsigned kStatusRtkShift = 27;
inline constexpr unsigned kStatusRtkMask = 0x3;
/// StatusWord: an axis at the end of its range; x, y, z from the given bit upwards.
inline constexpr unsigned kStatusAccelClipBit = 8;
inline constexpr unsigned kStatusGyroClipBit = 11;

/// UTC time, 12 bytes: u32 ns, u16 year, u8 month, day, hour, minute, second, flags.
inline constexpr std::size_t kUtcSize = 12;

}  // namespace imuscope::xsens
