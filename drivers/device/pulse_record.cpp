#include "drivers/device/pulse_record.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/bytes.h"
#include "base/contracts.h"

namespace imuscope {

namespace {

constexpr std::array<std::uint8_t, 3> kPulseMark{'P', 'P', 'S'};
constexpr std::size_t kPulseEdgeAt = 3;
constexpr std::size_t kPulseSequenceAt = 4;
constexpr std::size_t kPulseTimeAt = 8;
constexpr std::size_t kPulseWallAt = 16;
constexpr std::size_t kPulseApartAt = 24;
constexpr std::size_t kZeroAt = 28;
constexpr std::uint8_t kSteeringMark = 'q';
constexpr std::size_t kSteeringApartAt = 4;
constexpr std::size_t kUnsteeredAt = 16;
constexpr std::size_t kRateAt = 24;
constexpr double kRateUnit = 1e-9;
/// chrony slews by a tenth where it is told to; a clock that is steered by more is damage.
constexpr double kRateMax = 0.2;
/// Instants of a damaged capture are no reason to overflow.
constexpr std::int64_t kInstantMax_ns = std::numeric_limits<std::int64_t>::max() / 4;

bool is_instant(std::int64_t ns) noexcept { return ns >= -kInstantMax_ns && ns <= kInstantMax_ns; }

bool is_record(std::span<const std::uint8_t> bytes) noexcept {
  return bytes.size() >= kPulseRecordBytes &&
         std::equal(kPulseMark.begin(), kPulseMark.end(), bytes.begin()) &&
         read_le<std::uint32_t>(bytes, kZeroAt) == 0;
}

std::uint32_t recorded_ns(Duration apart) noexcept {
  return static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(apart.count(), 0, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

std::size_t write_steering_record(const ClockSteering& steering, std::span<std::uint8_t> out) noexcept {
  IMUSCOPE_EXPECTS(out.size() >= kPulseRecordBytes);
  std::copy(kPulseMark.begin(), kPulseMark.end(), out.begin());
  out[kPulseEdgeAt] = kSteeringMark;
  write_le(recorded_ns(steering.apart), out, kSteeringApartAt);
  write_le(static_cast<std::uint64_t>(to_ns(steering.time)), out, kPulseTimeAt);
  write_le(static_cast<std::uint64_t>(to_ns(steering.unsteered)), out, kUnsteeredAt);
  const double rate = std::clamp(steering.rate, -kRateMax, kRateMax);
  write_le(static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(rate / kRateUnit))), out,
           kRateAt);
  write_le(std::uint32_t{0}, out, kZeroAt);
  return kPulseRecordBytes;
}

std::optional<ClockSteering> read_steering_record(std::span<const std::uint8_t> bytes) noexcept {
  if (!is_record(bytes) || bytes[kPulseEdgeAt] != kSteeringMark) return std::nullopt;
  const auto time_ns = read_le<std::int64_t>(bytes, kPulseTimeAt);
  const auto unsteered_ns = read_le<std::int64_t>(bytes, kUnsteeredAt);
  const double rate = static_cast<double>(read_le<std::int32_t>(bytes, kRateAt)) * kRateUnit;
  if (!is_instant(time_ns) || !is_instant(unsteered_ns) || std::abs(rate) > kRateMax) return std::nullopt;
  return ClockSteering{host_time_from_ns(time_ns), host_time_from_ns(unsteered_ns), rate,
                       Duration{read_le<std::uint32_t>(bytes, kSteeringApartAt)}};
}

std::size_t write_pulse_record(const UtcPulse& pulse, std::span<std::uint8_t> out) noexcept {
  IMUSCOPE_EXPECTS(out.size() >= kPulseRecordBytes);
  std::copy(kPulseMark.begin(), kPulseMark.end(), out.begin());
  out[kPulseEdgeAt] = pulse.edge == PulseEdge::kAssert ? 'a' : 'c';
  write_le(pulse.sequence, out, kPulseSequenceAt);
  write_le(static_cast<std::uint64_t>(to_ns(pulse.time)), out, kPulseTimeAt);
  write_le(static_cast<std::uint64_t>(to_ns(pulse.wall)), out, kPulseWallAt);
  write_le(recorded_ns(pulse.apart), out, kPulseApartAt);
  write_le(std::uint32_t{0}, out, kZeroAt);
  return kPulseRecordBytes;
}

std::optional<UtcPulse> read_pulse_record(std::span<const std::uint8_t> bytes) noexcept {
  if (!is_record(bytes)) return std::nullopt;
  const std::uint8_t edge = bytes[kPulseEdgeAt];
  if (edge != 'a' && edge != 'c') return std::nullopt;
  const auto time_ns = read_le<std::int64_t>(bytes, kPulseTimeAt);
  const auto wall_ns = read_le<std::int64_t>(bytes, kPulseWallAt);
  if (!is_instant(time_ns) || !is_instant(wall_ns)) return std::nullopt;
  return UtcPulse{edge == 'a' ? PulseEdge::kAssert : PulseEdge::kClear,
                  read_le<std::uint32_t>(bytes, kPulseSequenceAt), host_time_from_ns(time_ns),
                  utc_time_from_ns(wall_ns), Duration{read_le<std::uint32_t>(bytes, kPulseApartAt)}};
}

}  // namespace imuscope
