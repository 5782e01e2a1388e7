#pragma once

/// Builds GREIS messages for tests, written from the protocol's layout and not from the decoder.

#include <array>
#include <bit>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "tests/drivers/support/streams.h"

namespace imuscope::test {

class Body {
 public:
  template <typename T>
  Body& put(T value) {
    if constexpr (std::is_same_v<T, double>) {
      return put_bits(std::bit_cast<std::uint64_t>(value), 8);
    } else if constexpr (std::is_same_v<T, float>) {
      return put_bits(std::bit_cast<std::uint32_t>(value), 4);
    } else {
      return put_bits(static_cast<std::uint64_t>(value), sizeof(T));
    }
  }
  Bytes bytes;

 private:
  Body& put_bits(std::uint64_t bits, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(bits >> (8 * i)));
    return *this;
  }
};

/// Header, body and checksum.
inline Bytes greis_message(std::string_view id, const Body& body) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  const std::size_t size = body.bytes.size() + 1;
  Bytes message = bytes_of(id);
  for (const unsigned shift : {8U, 4U, 0U}) {
    message.push_back(static_cast<std::uint8_t>(kHex[size >> shift & 0xFU]));
  }
  message.insert(message.end(), body.bytes.begin(), body.bytes.end());
  unsigned sum = 0;
  for (const std::uint8_t byte : message) sum = ((sum << 2U | sum >> 6U) & 0xFFU) ^ byte;
  message.push_back(static_cast<std::uint8_t>((sum << 2U | sum >> 6U) & 0xFFU));
  return message;
}

using U8 = std::uint8_t;
using U16 = std::uint16_t;
using U32 = std::uint32_t;

inline Bytes rt(U32 tod_ms) { return greis_message("~~", Body().put(tod_ms)); }
inline Bytes et(U32 tod_ms) { return greis_message("::", Body().put(tod_ms)); }
inline Bytes st(U32 tod_ms, U8 type) { return greis_message("ST", Body().put(tod_ms).put(type)); }
inline Bytes rd(U16 year, U8 month, U8 day, U8 base) {
  return greis_message("RD", Body().put(year).put(month).put(day).put(base));
}
inline Bytes to(double offset_s) { return greis_message("TO", Body().put(offset_s).put(offset_s)); }
inline Bytes pg(double lat_rad, double lon_rad, double alt_m, float sigma, U8 type) {
  return greis_message("PG", Body().put(lat_rad).put(lon_rad).put(alt_m).put(sigma).put(type));
}
inline Bytes vg(float north, float east, float up, float sigma, U8 type) {
  return greis_message("VG", Body().put(north).put(east).put(up).put(sigma).put(type));
}
inline Bytes po(const std::array<double, 3>& xyz_m, float sigma, U8 type) {
  return greis_message("PO", Body().put(xyz_m[0]).put(xyz_m[1]).put(xyz_m[2]).put(sigma).put(type));
}
inline Bytes ve(const std::array<double, 3>& v_mps, float sigma, U8 type) {
  const auto f = [&](std::size_t i) { return static_cast<float>(v_mps[i]); };
  return greis_message("VE", Body().put(f(0)).put(f(1)).put(f(2)).put(sigma).put(type));
}
inline Bytes sg(float hpos, float vpos, float hvel, float vvel, U8 type) {
  return greis_message("SG", Body().put(hpos).put(vpos).put(hvel).put(vvel).put(type));
}

/// Messages one after the other, CR LF after each.
inline Bytes lines(std::initializer_list<Bytes> messages) {
  Bytes all;
  for (const Bytes& message : messages) {
    all.insert(all.end(), message.begin(), message.end());
    all.push_back('\r');
    all.push_back('\n');
  }
  return all;
}

}  // namespace imuscope::test
