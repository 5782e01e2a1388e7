#pragma once

/// Every protocol that a device can speak, and what follows from it. A new one is a line here, its reader in
/// device_factory.cpp, and its driver.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "sample/sample.h"

namespace imuscope {

enum class DeviceRole : std::uint8_t { kReference, kStudy, kGnss, kOdometry, kTime };

enum class Protocol : std::uint8_t {
  kXsensMt,
  kIxblueStdbin,
  kGreis,
  kNmea,
  kUbx,
  kRtklibPos,
  kCsvImu,
  kCsvGnss,
  kXsensCan,
  kCanOdometry,
  kPps,
  kMcap,
  kRosbag,
  kUlog,
  kDataflash
};

/// What the rest of the service has to know of a protocol.
struct ProtocolTraits {
  Protocol protocol;
  std::string_view name;           ///< as the configuration writes it
  SampleKind purpose;              ///< what its devices are there for: kImu, kGnss, kOdometry or kPulse
  double rate_hz;                  ///< where the configuration gives none
  bool is_stream;                  ///< its bytes can be told from any others: probe and import look for it
  bool is_text = false;            ///< rows with named columns, read from files alone
  bool has_optical_gyros = false;  ///< all that speak it: navigation grade where nobody says otherwise
};

inline constexpr std::array<ProtocolTraits, 15> kProtocols{
    {{Protocol::kXsensMt, "xsens_mt", SampleKind::kImu, 100.0, true},
     {Protocol::kIxblueStdbin, "ixblue_stdbin", SampleKind::kImu, 100.0, true, false, true},
     {Protocol::kGreis, "greis", SampleKind::kGnss, 10.0, true},
     {Protocol::kNmea, "nmea", SampleKind::kGnss, 10.0, true},
     {Protocol::kUbx, "ubx", SampleKind::kGnss, 10.0, true},
     {Protocol::kRtklibPos, "rtklib_pos", SampleKind::kGnss, 10.0, true},
     {Protocol::kCsvImu, "csv_imu", SampleKind::kImu, 100.0, false, true},
     {Protocol::kCsvGnss, "csv_gnss", SampleKind::kGnss, 10.0, false, true},
     {Protocol::kXsensCan, "xsens_can", SampleKind::kImu, 100.0, false},
     {Protocol::kCanOdometry, "can_odometry", SampleKind::kOdometry, 50.0, false},
     {Protocol::kPps, "pps", SampleKind::kPulse, 1.0, false},
     {Protocol::kMcap, "mcap", SampleKind::kImu, 100.0, false},
     {Protocol::kRosbag, "rosbag", SampleKind::kImu, 100.0, false},
     {Protocol::kUlog, "ulog", SampleKind::kImu, 100.0, false},
     {Protocol::kDataflash, "dataflash", SampleKind::kImu, 100.0, false}}};

[[nodiscard]] constexpr const ProtocolTraits& traits_of(Protocol protocol) noexcept {
  return kProtocols[static_cast<std::size_t>(protocol)];
}
static_assert(
    [] {
      for (std::size_t i = 0; i < kProtocols.size(); ++i) {
        if (kProtocols[i].protocol != static_cast<Protocol>(i)) return false;
      }
      return true;
    }(),
    "the table is in the order of the enumeration");

[[nodiscard]] constexpr std::string_view name_of(Protocol protocol) noexcept {
  return traits_of(protocol).name;
}

/// Whether a device is messages of topics in a file that holds many: MCAP, a bag of ROS 1, a log of a flight
/// controller.
[[nodiscard]] constexpr bool is_message_log(Protocol protocol) noexcept {
  return protocol == Protocol::kMcap || protocol == Protocol::kRosbag || protocol == Protocol::kUlog ||
         protocol == Protocol::kDataflash;
}

/// Whether a device of this protocol can have a role. An XSens device with a receiver inside can be that, or
/// an IMU. Topics hold whatever there is.
[[nodiscard]] constexpr bool fits(Protocol protocol, DeviceRole role) noexcept {
  if (is_message_log(protocol)) return true;
  if (protocol == Protocol::kXsensMt) return role != DeviceRole::kOdometry && role != DeviceRole::kTime;
  switch (traits_of(protocol).purpose) {
    case SampleKind::kGnss:
      return role == DeviceRole::kGnss;
    case SampleKind::kOdometry:
      return role == DeviceRole::kOdometry;
    case SampleKind::kPulse:
      return role == DeviceRole::kTime;
    default:
      return role == DeviceRole::kReference || role == DeviceRole::kStudy;
  }
}

}  // namespace imuscope
