#pragma once

/// What is taken from a message of ROS, as bytes: the form in which messages of an MCAP file travel to the
/// decoder and into a capture, so that they come from a device like any other. Frames of ROS (east-north-up,
/// covariances) have become ours (north-east-down, standard deviations); the axes of an IMU are as the
/// message has them.
///
/// A frame, least significant byte first:
///
///     offset 0  u8[4]  A7 "ROS"
///            4  u8     Kind
///            5  u8     flags: of an IMU MessageFlag, of a solution GnssSolution and MessageFlag
///            6  u16    0
///            8  i64    time of validity, ns
///           16  f64[]  values of the kind
///          end  u32    CRC-32 (that of zlib) of all before it

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/time.h"
#include "sample/sample.h"

namespace imuscope::ros_message {

enum class Kind : std::uint8_t { kImu = 1, kGnss = 2, kSpeed = 3, kTimeReference = 4 };

enum MessageFlag : std::uint8_t {
  kHasGyro = 1U << 0U,
  kHasAccel = 1U << 1U,
  kHasSdPosition = 1U << 3U,
  kHasVelocity = 1U << 4U,
  kHasSdVelocity = 1U << 5U,
};
/// Bits of a solution's flags that hold its GnssSolution.
inline constexpr std::uint8_t kSolutionBits = 0x07;

/// kImu: rate x y z rad/s, specific force x y z m/s^2. kGnss: latitude and longitude rad, height m, sd north
/// east down m, velocity north east down m/s, its sd. kSpeed: forward, m/s. kTimeReference: UTC less whole
/// seconds of 1970, s, and these.
inline constexpr std::size_t kValuesMost = 12;

/// What a frame holds; values beyond those of its kind are zero.
struct Content {
  Kind kind = Kind::kImu;
  std::uint8_t flags = 0;
  std::int64_t time_ns = 0;
  std::array<double, kValuesMost> values{};
};

[[nodiscard]] std::size_t value_count(Kind kind) noexcept;
inline constexpr std::size_t kHeadBytes = 16;
inline constexpr std::size_t kChecksumBytes = 4;
inline constexpr std::size_t kFrameMost = kHeadBytes + kValuesMost * sizeof(double) + kChecksumBytes;
inline constexpr std::array<std::uint8_t, 4> kMark{0xA7, 'R', 'O', 'S'};

/// @param out  of at least kFrameMost
/// @return bytes written
std::size_t write_frame(const Content& content, std::span<std::uint8_t> out) noexcept;
/// The content of a whole frame whose checksum is right.
[[nodiscard]] Content read_frame(std::span<const std::uint8_t> frame) noexcept;

}  // namespace imuscope::ros_message
