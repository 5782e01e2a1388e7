#include "firmware_sim/devices/xsens_encoder.h"

#include <cmath>

namespace imusim::xsens {
void put_number(Bytes& bytes, double value, std::uint32_t settings) {
  switch (settings & kSettingsDouble) {
    case kSettingsF1220:
      put_be(bytes, static_cast<std::int32_t>(std::llround(std::ldexp(value, 20))));
      return;
    case kSettingsFp1632: {
      // Four bytes of fraction first, then two bytes of integer.
      const auto fixed = static_cast<std::int64_t>(std::llround(std::ldexp(value, 32)));
      put_be(bytes, static_cast<std::uint32_t>(fixed & 0xFFFFFFFF));
      put_be(bytes, static_cast<std::int16_t>(fixed >> 32));
      return;
    }
    case kSettingsDouble:
      put_be(bytes, value);
      return;
    default:
      put_be(bytes, static_cast<float>(value));
  }
}

namespace {

constexpr std::uint8_t kPreamble = 0xFA;
constexpr std::uint8_t kExtendedLength = 0xFF;

template <typename Vector>
void put_vector(Bytes& bytes, const Vector& values, std::uint32_t settings) {
  for (const double value : values) put_number(bytes, value, settings);
}

void put_orientation(Bytes& bytes, const MtSample& sample, std::uint32_t settings) {
  if ((settings & kSettingsMatrix) != 0) {
    // Elements a to i run down the columns.
    const Eigen::Matrix3d R = sample.sensor_to_world.toRotationMatrix();
    for (int column = 0; column < 3; ++column)
      for (int row = 0; row < 3; ++row) put_number(bytes, R(row, column), settings);
  } else if ((settings & kSettingsEuler) != 0) {
    put_vector(bytes, sample.euler_deg, settings);
  } else {
    const Eigen::Quaterniond& q = sample.sensor_to_world;
    put_vector(bytes, Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()), settings);
  }
}

}  // namespace

Bytes frame(std::uint8_t mid, std::span<const std::uint8_t> data, std::uint8_t bid) {
  Bytes bytes = {kPreamble, bid, mid};
  if (data.size() < kExtendedLength) {
    bytes.push_back(static_cast<std::uint8_t>(data.size()));
  } else {
    bytes.push_back(kExtendedLength);
    put_be(bytes, static_cast<std::uint16_t>(data.size()));
  }
  put_bytes(bytes, data);
  unsigned sum = 0;
  for (std::size_t i = 1; i < bytes.size(); ++i) sum += bytes[i];
  bytes.push_back(static_cast<std::uint8_t>(0U - sum));
  return bytes;
}

Bytes mtdata_payload(const MtSample& sample, std::uint16_t output_mode, std::uint32_t output_settings) {
  Bytes bytes;
  if ((output_mode & kModeTemperature) != 0) put_number(bytes, sample.temperature_degC, output_settings);
  if ((output_mode & kModeCalibrated) != 0) {
    if ((output_settings & kSettingsNoAcc) == 0) put_vector(bytes, sample.acc_mps2, output_settings);
    if ((output_settings & kSettingsNoGyr) == 0) put_vector(bytes, sample.gyr_radps, output_settings);
    if ((output_settings & kSettingsNoMag) == 0) put_vector(bytes, sample.mag, output_settings);
  }
  if ((output_mode & kModeOrientation) != 0) put_orientation(bytes, sample, output_settings);
  if ((output_mode & kModeStatus) != 0) bytes.push_back(sample.status);
  if ((output_settings & kSettingsCounter) != 0) put_be(bytes, sample.counter);
  return bytes;
}

}  // namespace imusim::xsens
