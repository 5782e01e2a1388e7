#pragma once

/// Frames as an MT device sends them, for tests.

#include <array>
#include <bit>
#include <cstdint>
#include <numeric>
#include <span>

#include "drivers/xsens_mt/messages.h"
#include "tests/drivers/support/streams.h"

namespace imuscope::xsens::test_frames {

using test::Bytes;

template <std::size_t N>
void append(Bytes& bytes, const std::array<std::uint8_t, N>& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}
inline void append_float(Bytes& bytes, double value) {
  append(bytes, be32(std::bit_cast<std::uint32_t>(static_cast<float>(value))));
}

inline Bytes frame(std::uint8_t mid, const Bytes& data = {}, std::uint8_t bid = kMasterBid) {
  Bytes bytes{kPreamble, bid, mid};
  if (data.size() < kExtendedLength) {
    bytes.push_back(static_cast<std::uint8_t>(data.size()));
  } else {
    bytes.push_back(kExtendedLength);
    append(bytes, be16(static_cast<std::uint16_t>(data.size())));
  }
  bytes.insert(bytes.end(), data.begin(), data.end());
  const auto sum = std::accumulate(bytes.begin() + 1, bytes.end(), 0U);
  bytes.push_back(static_cast<std::uint8_t>(0U - sum));
  return bytes;
}

/// Calibrated float32 data with the sample counter (kDefaultLayout).
inline Bytes mtdata(std::uint16_t counter, const std::array<double, 3>& force = {0.1, -0.2, 9.8},
                    const std::array<double, 3>& rate = {0.01, 0.02, -0.03}) {
  Bytes data;
  for (const double v : force) append_float(data, v);
  for (const double v : rate) append_float(data, v);
  for (const double v : {0.5, 0.25, -0.75}) append_float(data, v);
  append(data, be16(counter));
  return frame(mid::kMtData, data);
}

inline void append_item(Bytes& data, std::uint16_t id, const Bytes& content) {
  append(data, be16(id));
  data.push_back(static_cast<std::uint8_t>(content.size()));
  data.insert(data.end(), content.begin(), content.end());
}
inline Bytes u16(std::uint16_t v) {
  const auto b = be16(v);
  return {b.begin(), b.end()};
}
inline Bytes u32(std::uint32_t v) {
  const auto b = be32(v);
  return {b.begin(), b.end()};
}
inline Bytes floats(std::initializer_list<double> values) {
  Bytes out;
  for (const double v : values) append_float(out, v);
  return out;
}

/// Configuration message of devices that all have the same layout.
inline Bytes configuration(std::uint16_t period, std::uint16_t skip, std::uint16_t n_devices,
                           std::uint16_t length, std::uint16_t mode, std::uint32_t settings,
                           std::uint32_t master_id = 0x00300123, std::uint16_t sync_mode = 0,
                           std::uint16_t sync_skip = 0, std::uint32_t sync_offset = 0) {
  Bytes data;
  append(data, be32(master_id));
  append(data, be16(period));
  append(data, be16(skip));
  append(data, be16(sync_mode));
  append(data, be16(sync_skip));
  append(data, be32(sync_offset));
  data.resize(96);
  append(data, be16(n_devices));
  for (std::uint16_t k = 0; k < n_devices; ++k) {
    append(data,
           be32(n_devices == 1 && (master_id & 0x00F00000U) != 0x00100000U ? master_id : 0x00300200U + k));
    append(data, be16(length));
    append(data, be16(mode));
    append(data, be32(settings));
    data.resize(98 + 20U * (k + 1U));
  }
  return frame(mid::kConfiguration, data);
}

}  // namespace imuscope::xsens::test_frames
