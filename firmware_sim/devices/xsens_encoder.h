#pragma once

/// Wire frames of the XSens MT binary protocol (legacy MTData), from the manuals MT0100P and MT0101P.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>

#include "firmware_sim/devices/bytes.h"

namespace imusim::xsens {

/// Message ids, request and reply.
enum Mid : std::uint8_t {
  kReqDid = 0x00,
  kDeviceId = 0x01,
  kInitMt = 0x02,
  kPeriod = 0x04,
  kReqDataLength = 0x0A,
  kReqConfiguration = 0x0C,
  kConfiguration = 0x0D,
  kRestoreFactoryDef = 0x0E,
  kGoToMeasurement = 0x10,
  kReqFirmwareRevision = 0x12,
  kBaudrate = 0x18,
  kReqProductCode = 0x1C,
  kReqHardwareVersion = 0x1E,
  kRunSelftest = 0x24,
  kGoToConfig = 0x30,
  kMtData = 0x32,
  kReqData = 0x34,
  kMtData2 = 0x36,
  kWakeUp = 0x3E,
  kWakeUpAck = 0x3F,
  kReset = 0x40,
  kError = 0x42,
  kOutputConfiguration = 0xC0,
  kOutputMode = 0xD0,
  kOutputSettings = 0xD2,
  kOutputSkipFactor = 0xD4,
  kSyncInSettings = 0xD6,
  kSyncOutSettings = 0xD8,
  kErrorMode = 0xDA,
  kTransmitDelay = 0xDC,
};

/// Bits of OutputMode that this firmware knows.
enum OutputModeBit : std::uint16_t {
  kModeTemperature = 0x0001,
  kModeCalibrated = 0x0002,
  kModeOrientation = 0x0004,
  kModeStatus = 0x0800,
};
inline constexpr std::uint16_t kKnownModes =
    kModeTemperature | kModeCalibrated | kModeOrientation | kModeStatus;

/// Bits of OutputSettings that this firmware knows. Bits 4 to 6 switch channels off.
enum OutputSettingsBit : std::uint32_t {
  kSettingsCounter = 0x0001,
  kSettingsEuler = 0x0004,
  kSettingsMatrix = 0x0008,
  kSettingsNoAcc = 0x0010,
  kSettingsNoGyr = 0x0020,
  kSettingsNoMag = 0x0040,
  kSettingsF1220 = 0x0100,
  kSettingsFp1632 = 0x0200,
  kSettingsDouble = 0x0300,
};
inline constexpr std::uint32_t kKnownSettings = kSettingsCounter | kSettingsEuler | kSettingsMatrix |
                                                kSettingsNoAcc | kSettingsNoGyr | kSettingsNoMag |
                                                kSettingsDouble;

/// What one MTData message can carry, in the device's own axes.
struct MtSample {
  double temperature_degC = 25.0;
  Eigen::Vector3d acc_mps2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyr_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d mag = Eigen::Vector3d::Zero();
  Eigen::Quaterniond sensor_to_world = Eigen::Quaterniond::Identity();  ///< world: X north, Y west, Z up
  Eigen::Vector3d euler_deg = Eigen::Vector3d::Zero();                  ///< roll, pitch, yaw
  std::uint8_t status = 0x02;                                           ///< bit 1: filter valid
  std::uint16_t counter = 0;
};

/// A whole frame with preamble, length (extended where needed) and checksum.
Bytes frame(std::uint8_t mid, std::span<const std::uint8_t> data, std::uint8_t bid = 0xFF);

/// One number in the format of OutputSettings bits 8 and 9.
void put_number(Bytes& bytes, double value, std::uint32_t output_settings);

/// Payload of an MTData message: the fields that mode and settings select, in the protocol's fixed order.
Bytes mtdata_payload(const MtSample& sample, std::uint16_t output_mode, std::uint32_t output_settings);

}  // namespace imusim::xsens
