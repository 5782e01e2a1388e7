#pragma once

/// The CAN messages of an MTi-600 that an IMU is made of, most significant byte first. One sample comes as
/// several frames, a group. Core: no allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/device/can_frame.h"

namespace imuscope::xsens_can {

enum class Item : std::uint8_t {
  kError,          ///< u8
  kSampleTime,     ///< u32, ticks of 100 us or 1 us
  kGroupCounter,   ///< u16
  kStatusWord,     ///< u32
  kDeltaV,         ///< 3 x i16, u8 exponent: raw 2^-e m/s
  kRateOfTurn,     ///< 3 x i16, 2^-9 rad/s
  kDeltaQ,         ///< 4 x i16 / 32767
  kAcceleration,   ///< 3 x i16, 2^-8 m/s^2
  kHighRateFirst,  ///< 3 x i16: acceleration or rate of turn, which one differs between documents
  kHighRateSecond,
};
inline constexpr std::size_t kItemCount = 10;

/// One of the CAN messages that are read: its name, and what the device sends it as.
struct ItemKind {
  std::string_view name;  ///< as the configuration writes it
  std::uint32_t id;       ///< the device's default; another one can be set per message
  std::size_t size;       ///< bytes
};
/// In the order of Item. XSens MT Low Level documentation, XCDI list.
inline constexpr std::array<ItemKind, kItemCount> kItemKinds{{{"error", 0x001, 1},
                                                              {"sample_time", 0x005, 4},
                                                              {"group_counter", 0x006, 2},
                                                              {"status_word", 0x011, 4},
                                                              {"delta_v", 0x031, 7},
                                                              {"rate_of_turn", 0x032, 6},
                                                              {"delta_q", 0x033, 8},
                                                              {"acceleration", 0x034, 6},
                                                              {"high_rate_061", 0x061, 6},
                                                              {"high_rate_062", 0x062, 6}}};

/// Identifier of every message, in the order of Item.
using ItemIds = std::array<CanId, kItemCount>;
[[nodiscard]] ItemIds default_ids() noexcept;

using Triad = std::array<double, 3>;
using RawTriad = std::array<std::int16_t, 3>;

/// Scales of the fixed-point numbers.
inline constexpr double kRate_radps = 1.0 / 512.0;
inline constexpr double kAcceleration_mps2 = 1.0 / 256.0;

/// The readers give nothing where the frame is shorter than the message.
[[nodiscard]] std::optional<std::uint32_t> read_u32(std::span<const std::uint8_t> data) noexcept;
[[nodiscard]] std::optional<std::uint16_t> read_u16(std::span<const std::uint8_t> data) noexcept;
[[nodiscard]] std::optional<RawTriad> read_raw(std::span<const std::uint8_t> data) noexcept;
[[nodiscard]] std::optional<Triad> read_scaled(std::span<const std::uint8_t> data, double scale) noexcept;
[[nodiscard]] std::optional<Triad> read_delta_v(std::span<const std::uint8_t> data) noexcept;
[[nodiscard]] std::optional<std::array<double, 4>> read_delta_q(std::span<const std::uint8_t> data) noexcept;

}  // namespace imuscope::xsens_can
