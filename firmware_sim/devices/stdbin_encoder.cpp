#include "firmware_sim/devices/stdbin_encoder.h"

#include <numeric>

namespace imusim::stdbin {
namespace {

constexpr std::uint8_t kVersion = 3;
constexpr std::size_t kHeaderSize = 25;
constexpr std::size_t kChecksumSize = 4;
constexpr std::uint8_t kAltitudeFromEllipsoid = 1;

/// Collects the blocks of one mask in rising order of their bits.
struct Blocks {
  std::uint32_t mask = 0;
  Bytes bytes;

  void add(unsigned bit, const std::optional<Eigen::Vector3d>& values) {
    if (!values) return;
    mask |= 1U << bit;
    for (const double value : *values) put_be(bytes, static_cast<float>(value));
  }
};

void add_position(Blocks& blocks, const Telegram& telegram) {
  if (telegram.position) {
    blocks.mask |= 1U << 7U;
    put_be(blocks.bytes, telegram.position->latitude_deg);
    put_be(blocks.bytes, telegram.position->longitude_deg);
    blocks.bytes.push_back(kAltitudeFromEllipsoid);
    put_be(blocks.bytes, static_cast<float>(telegram.position->altitude_m));
  }
  if (telegram.position_sd) {
    blocks.mask |= 1U << 8U;
    put_be(blocks.bytes, static_cast<float>(telegram.position_sd->north_m));
    put_be(blocks.bytes, static_cast<float>(telegram.position_sd->east_m));
    put_be(blocks.bytes, static_cast<float>(telegram.position_sd->north_east_m2));
    put_be(blocks.bytes, static_cast<float>(telegram.position_sd->altitude_m));
  }
}

void add_date_and_status(Blocks& blocks, const Telegram& telegram) {
  if (telegram.date) {
    blocks.mask |= 1U << 13U;
    blocks.bytes.push_back(telegram.date->day);
    blocks.bytes.push_back(telegram.date->month);
    put_be(blocks.bytes, telegram.date->year);
  }
  if (telegram.sensor_status) {
    blocks.mask |= 1U << 14U;
    for (const std::uint32_t word : *telegram.sensor_status) put_be(blocks.bytes, word);
  }
  if (telegram.user_status) {
    blocks.mask |= 1U << 17U;
    put_be(blocks.bytes, *telegram.user_status);
  }
}

Blocks navigation_blocks(const Telegram& telegram) {
  Blocks blocks;
  blocks.add(0, telegram.heading_roll_pitch_deg);
  blocks.add(1, telegram.heading_roll_pitch_sd_deg);
  add_position(blocks, telegram);
  blocks.add(9, telegram.speed_neu_mps);
  blocks.add(10, telegram.speed_sd_neu_mps);
  add_date_and_status(blocks, telegram);
  blocks.add(28, telegram.raw_acceleration_mps2);
  return blocks;
}

Blocks extended_blocks(const Telegram& telegram) {
  Blocks blocks;
  blocks.add(0, telegram.rotation_acceleration_degps2);
  blocks.add(2, telegram.raw_rotation_rate_degps);
  return blocks;
}

}  // namespace

Bytes encode(const Telegram& telegram) {
  const Blocks navigation = navigation_blocks(telegram);
  const Blocks extended = extended_blocks(telegram);
  Bytes bytes = {'I', 'X', kVersion};
  put_be(bytes, navigation.mask);
  put_be(bytes, extended.mask);
  put_be(bytes, std::uint32_t{0});  // no external sensor blocks
  const std::size_t size = kHeaderSize + navigation.bytes.size() + extended.bytes.size() + kChecksumSize;
  put_be(bytes, static_cast<std::uint16_t>(size));
  put_be(bytes, telegram.validity_100us);
  put_be(bytes, telegram.counter);
  put_bytes(bytes, navigation.bytes);
  put_bytes(bytes, extended.bytes);
  put_be(bytes, std::accumulate(bytes.begin(), bytes.end(), std::uint32_t{0}));
  return bytes;
}

}  // namespace imusim::stdbin
