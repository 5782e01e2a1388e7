#pragma once

/// Builds UBX messages for tests, written from the protocol's layout and not from the decoder.

#include <cstdint>

#include "tests/drivers/support/streams.h"

namespace imuscope::test {

inline Bytes ubx_message(std::uint8_t message_class, std::uint8_t id, const Bytes& payload) {
  Bytes bytes;
  bytes.reserve(payload.size() + 8);
  const auto size = static_cast<unsigned>(payload.size());
  for (const unsigned byte :
       {0xB5U, 0x62U, unsigned{message_class}, unsigned{id}, size & 0xFFU, size >> 8U}) {
    bytes.push_back(static_cast<std::uint8_t>(byte));
  }
  for (const std::uint8_t byte : payload) bytes.push_back(byte);
  unsigned a = 0, b = 0;
  for (std::size_t i = 2; i < bytes.size(); ++i) {
    a = (a + bytes[i]) & 0xFFU;
    b = (b + a) & 0xFFU;
  }
  bytes.push_back(static_cast<std::uint8_t>(a));
  bytes.push_back(static_cast<std::uint8_t>(b));
  return bytes;
}

/// A fixed solution of 92 bytes on 2026-03-14.
inline Bytes ubx_nav_pvt(std::uint32_t itow_ms) {
  Bytes payload(92, 0);
  const auto put = [&](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) payload[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
  };
  put(0, itow_ms);
  put(4, 2026U | 3U << 16U | 14U << 24U);
  payload[8] = 12, payload[9] = 34, payload[10] = 56, payload[11] = 0x07;
  payload[20] = 3, payload[21] = 0x81;
  put(24, 23'522'190), put(28, 488'566'140), put(32, 81'500), put(36, 35'250);
  put(40, 14), put(44, 20), put(48, 1250), put(68, 50);
  return ubx_message(1, 7, payload);
}

}  // namespace imuscope::test
