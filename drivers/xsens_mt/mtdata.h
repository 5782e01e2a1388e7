#pragma once

/// Legacy data of the MTx and MTi (MTData, 0x32): which fields a message holds is not in the message, but in
/// the device's output mode and output settings. Fields come in a fixed order, each only if selected.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/bytes.h"
#include "drivers/xsens_mt/wire.h"

namespace imuscope::xsens {

/// What a device was told to send; see namespaces output_mode and output_settings.
struct DataLayout {
  std::uint16_t mode = 0;
  std::uint32_t settings = 0;

  [[nodiscard]] NumberFormat format() const noexcept {
    return static_cast<NumberFormat>((settings & output_settings::kFormatMask) >>
                                     output_settings::kFormatShift);
  }
  friend bool operator==(const DataLayout&, const DataLayout&) = default;
};

/// Bytes of one device's data. Calibrated or orientation together with raw is not a layout: nothing.
std::optional<std::size_t> data_length(const DataLayout& layout) noexcept;

/// Fields that a message holds.
enum class Field : std::uint32_t {
  kRaw = 1U << 0U,
  kGpsPvt = 1U << 1U,
  kTemperature = 1U << 2U,
  kAcceleration = 1U << 3U,
  kRate = 1U << 4U,
  kMagneticField = 1U << 5U,
  kQuaternion = 1U << 6U,
  kEuler = 1U << 7U,
  kMatrix = 1U << 8U,
  kAnalogue1 = 1U << 9U,
  kAnalogue2 = 1U << 10U,
  kPosition = 1U << 11U,
  kVelocity = 1U << 12U,
  kStatus = 1U << 13U,
  kCounter = 1U << 14U,
  kUtc = 1U << 15U,
};

/// Uncalibrated readings (output mode "raw"), counts of the converters; no sample is made of them.
struct RawInertial {
  std::array<std::uint16_t, 3> acceleration{};  ///< ADC counts
  std::array<std::uint16_t, 3> rate{};
  std::array<std::uint16_t, 3> field{};
  std::uint16_t temperature = 0;
};

/// GPS solution of an MTi-G, in the receiver's units.
struct GpsPvt {
  std::uint16_t pressure = 0;
  std::uint8_t pressure_age = 0;
  std::uint32_t time_of_week_ms = 0;
  std::int32_t latitude_1e7_deg = 0;
  std::int32_t longitude_1e7_deg = 0;
  std::int32_t altitude_mm = 0;
  std::array<std::int32_t, 3> velocity_ned_cmps{};
  std::uint32_t horizontal_accuracy_mm = 0;
  std::uint32_t vertical_accuracy_mm = 0;
  std::uint32_t speed_accuracy_cmps = 0;
  std::uint8_t gps_age = 0;
};

/// UTC as a device sends it, in MTData and as item 0x1010 of MTData2; utc_ns() says whether it is to be
/// believed.
struct UtcFields {
  std::uint32_t nanoseconds = 0;
  std::uint16_t year = 0;
  std::uint8_t month = 0;
  std::uint8_t day = 0;
  std::uint8_t hour = 0;
  std::uint8_t minute = 0;
  std::uint8_t second = 0;
  std::uint8_t flags = 0;  ///< bit 0 date valid, 1 time of day valid, 2 leap seconds resolved
};

/// Reads kUtcSize bytes.
UtcFields read_utc(std::span<const std::uint8_t> data) noexcept;

/// Nanoseconds since 1970 where the date and time of day are possible and said to be valid.
std::optional<std::int64_t> utc_ns(const UtcFields& utc) noexcept;

/// One device's data. Only what has() says is meaningful.
struct MtData {
  std::uint32_t fields = 0;  ///< Field bits
  RawInertial raw;
  GpsPvt gps;
  double temperature_degc = 0.0;
  std::array<double, 3> acceleration_mps2{};  ///< specific force
  std::array<double, 3> rate_radps{};
  std::array<double, 3> field_au{};        ///< 1 = the field at the calibration site
  std::array<double, 4> quaternion{};      ///< sensor to local, scalar first
  std::array<double, 3> euler_deg{};       ///< roll, pitch, yaw
  std::array<double, 9> matrix_as_sent{};  ///< sensor to local, column by column
  std::array<std::uint16_t, 2> analogue{};
  std::array<double, 3> position{};  ///< latitude deg, longitude deg, altitude m
  std::array<double, 3> velocity_mps{};
  std::uint8_t status = 0;  ///< bit 0 self test, 1 filter valid, 2 GPS fix
  std::uint16_t counter = 0;
  UtcFields utc;

  [[nodiscard]] bool has(Field field) const noexcept {
    return (fields & static_cast<std::uint32_t>(field)) != 0;
  }
};

/// Reads one device's data into `out`: its fields, and what has() says of it; the rest stays as it was.
/// @return false where the data's length is not that of the layout
[[nodiscard]] bool read_mtdata(std::span<const std::uint8_t> data, const DataLayout& layout,
                               MtData& out) noexcept;

/// The same for data that is known to be data_length(layout) long.
void read_mtdata_of_known_length(std::span<const std::uint8_t> data, const DataLayout& layout,
                                 MtData& out) noexcept;

inline constexpr double kFixed1220Step = 1.0 / (1U << 20U);
inline constexpr double kFixed1632Step = 1.0 / static_cast<double>(std::uint64_t{1} << 32U);

/// One real number at `data[offset]`.
inline double read_number(std::span<const std::uint8_t> data, std::size_t offset,
                          NumberFormat format) noexcept {
  switch (format) {
    case NumberFormat::kFloat32:
      return static_cast<double>(read_be<float>(data, offset));
    case NumberFormat::kFixed1220:
      return read_be<std::int32_t>(data, offset) * kFixed1220Step;
    case NumberFormat::kFixed1632: {
      // The four fraction bytes come before the two integer bytes.
      const std::int64_t fraction = read_be<std::uint32_t>(data, offset);
      const std::int64_t integer = read_be<std::int16_t>(data, offset + 4);
      return static_cast<double>(integer * (std::int64_t{1} << 32) + fraction) * kFixed1632Step;
    }
    case NumberFormat::kFloat64:
      return read_be<double>(data, offset);
  }
  return 0.0;
}

}  // namespace imuscope::xsens
