#pragma once

/// What the items of one MTData2 message say to a driver: inertial data, time, orientation, GNSS and status.

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/device/attitude_angles.h"
#include "drivers/xsens_mt/mtdata.h"
#include "sample/sample.h"

namespace imuscope::xsens {

/// Local frame of an orientation.
enum class LocalFrame : std::uint8_t { kEastNorthUp = 0, kNorthEastDown = 1, kNorthWestUp = 2 };

/// Only what has() says is meaningful.
struct InertialMessage {
  enum Item : std::uint32_t {
    kAcceleration = 1U << 0U,
    kRate = 1U << 1U,
    kDeltaV = 1U << 2U,
    kDeltaQ = 1U << 3U,
    kPacketCounter = 1U << 4U,
    kSampleTimeFine = 1U << 5U,
    kUtc = 1U << 6U,
    kOrientation = 1U << 7U,
    kGnss = 1U << 8U,
    kStatus = 1U << 9U,
    kTemperature = 1U << 10U,
  };
  std::uint32_t items = 0;
  std::uint32_t status_word = 0;  ///< 0 where none was sent
  std::array<double, 1> temperature_degC;
  std::array<double, 3> acceleration_mps2;
  std::array<double, 3> rate_radps;
  std::array<double, 3> delta_v_mps;
  std::array<double, 4> delta_q;
  std::uint16_t packet_counter;
  std::uint32_t sample_time_fine;
  UtcFields utc;
  Matrix3 C_s_l;  ///< rotates the sensor's components to those of the local frame
  LocalFrame frame;
  std::span<const std::uint8_t> gnss;  ///< of kGnssPvtSize bytes

  [[nodiscard]] bool has(Item item) const noexcept { return (items & item) != 0; }
};

/// Reads all items into `out`. Items of the wrong size are passed over.
/// @return false where the items do not fill the data exactly: then nothing of it is to be used
[[nodiscard]] bool read_inertial(std::span<const std::uint8_t> data, InertialMessage& out) noexcept;

/// Orientation of legacy data, if it has one.
[[nodiscard]] std::optional<Matrix3> orientation_of(const MtData& data) noexcept;
/// Its local frame: magnetic north, west, up, unless the settings ask for north, east, down.
[[nodiscard]] LocalFrame local_frame_of(const DataLayout& layout) noexcept;

/// Attitude of b = axes * s relative to north-east-down. The heading is never marked valid: whether the
/// device refers it to magnetic or to true north is not in its data.
[[nodiscard]] AttitudeData attitude_of(const Matrix3& C_s_l, LocalFrame frame, const Matrix3& axes) noexcept;

/// ImuFlag bits of the axes that a status word calls clipped.
[[nodiscard]] constexpr std::uint32_t clip_flags(std::uint32_t status_word) noexcept {
  constexpr std::uint32_t kAxes = 0x7;  // x, y, z stand side by side in both
  static_assert(kAccelClipY == 2U * kAccelClipX && kAccelClipZ == 4U * kAccelClipX);
  static_assert(kGyroClipY == 2U * kGyroClipX && kGyroClipZ == 4U * kGyroClipX);
  return (status_word >> kStatusAccelClipBit & kAxes) * kAccelClipX |
         (status_word >> kStatusGyroClipBit & kAxes) * kGyroClipX;
}

/// Rotation vector of a rotation.
[[nodiscard]] std::array<double, 3> rotation_vector(const std::array<double, 4>& q) noexcept;

}  // namespace imuscope::xsens
