#pragma once

/// One pulse that marks a second of UTC (PPS, RFC 2783), and its form as bytes: the form in which pulses
/// travel from a PPS device of the kernel to the decoder and into the capture, so that it is a device like
/// any other.
///
/// A record, least significant byte first:
///
///     offset 0  u8[4]  "PPS", then "a" for the assert edge or "c" for the clear edge
///            4  u32    the kernel's count of such edges
///            8  i64    when it came, CLOCK_MONOTONIC, ns
///           16  i64    the same by CLOCK_REALTIME, ns, which is how the kernel stamps it
///           24  u32    the two clocks were read within so many ns, so that the one is known from the other
///           28  u32    0
///
/// and, between the pulses, how the PC steers the clock by which they are stamped:
///
///     offset 0  u8[4]  "PPSq"
///            4  u32    the two clocks were read within so many ns
///            8  i64    an instant, CLOCK_MONOTONIC, ns
///           16  i64    the same by CLOCK_MONOTONIC_RAW, which nobody steers, ns
///           24  i32    seconds of that clock in one of the other from there on, minus 1, 1e-9
///           28  u32    0

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/time.h"

namespace imuscope {

inline constexpr std::size_t kPulseRecordBytes = 32;

enum class PulseEdge : std::uint8_t { kAssert, kClear };

struct UtcPulse {
  PulseEdge edge = PulseEdge::kAssert;
  std::uint32_t sequence = 0;
  HostTime time{};
  UtcTime wall{};  ///< by the PC's wall clock
  Duration apart{};
};

/// From here on the host's clock is steered so, until told otherwise.
struct ClockSteering {
  HostTime time{};
  HostTime unsteered{};  ///< by the quartz left alone, which counts from elsewhere
  double rate = 0.0;     ///< its seconds in one of the host's clock, minus 1; recorded to 1e-9
  Duration apart{};
};

/// @param out  of at least kPulseRecordBytes
/// @return bytes written
/// Core: no allocation.
std::size_t write_steering_record(const ClockSteering& steering, std::span<std::uint8_t> out) noexcept;

/// The record at the beginning of `bytes`; nothing where there is none. Core: no allocation.
[[nodiscard]] std::optional<ClockSteering> read_steering_record(std::span<const std::uint8_t> bytes) noexcept;

/// @param out  of at least kPulseRecordBytes
/// @return bytes written
/// Core: no allocation.
std::size_t write_pulse_record(const UtcPulse& pulse, std::span<std::uint8_t> out) noexcept;

/// The record at the beginning of `bytes`; nothing where there is none. Core: no allocation.
[[nodiscard]] std::optional<UtcPulse> read_pulse_record(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace imuscope
