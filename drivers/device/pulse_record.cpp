#include "drivers/device/pulse_record.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/contracts.h"
#include "drivers/device/bytes.h"

namespace imuscope {

namespace {

constexpr std::array<std::uint8_t, 3> kPulseMark{'P', 'P', 'S'};
constexpr std::size_t kPulseEdgeAt = 3;
constexpr std::size_t kPulseSequenceAt = 4;
constexpr std::size_t kPulseTimeAt = 8;
constexpr std::size_t kPulseWallAt = 16;
constexpr std::size_t kPulseApartAt = 24;
constexpr std::size_t kZeroAt = 28;
/// Instants of a damaged capture are no reason to overflow.
constexpr std::int64_t kInstantMax_ns = std::numeric_limits<std::int64_t>::max() / 4;

bool is_instant(std::int64_t ns) noexcept { return ns >= -kInstantMax_ns && ns <= kInstantMax_ns; }

}  // namespace

std::size_t write_pulse_record(const UtcPulse& pulse, std::span<std::uint8_t> out) noexcept {
  IMUSCOPE_EXPECTS(out.size() >= kPulseRecordBytes);
  std::copy(kPulseMark.begin(), kPulseMark.end(), out.begin());
  out[kPulseEdgeAt] = pulse.edge == PulseEdge::kAssert ? 'a' : 'c';
  write_le(pulse.sequence, out, kPulseSequenceAt);
  write_le(static_cast<std::uint64_t>(to_ns(pulse.time)), out, kPulseTimeAt);
  write_le(static_cast<std::uint64_t>(to_ns(pulse.wall)), out, kPulseWallAt);
  const std::int64_t apart_ns =
      std::clamp<std::int64_t>(pulse.apart.count(), 0, std::numeric_limits<std::uint32_t>::max());
  write_le(static_cast<std::uint32_t>(apart_ns), out, kPulseApartAt);
  write_le(std::uint32_t{0}, out, kZeroAt);
  return kPulseRecordBytes;
}

std::optional<UtcPulse> read_pulse_record(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() < kPulseRecordBytes || !std::equal(kPulseMark.begin(), kPulseMark.end(), bytes.begin()))
    return std::nullopt;
  const std::uint8_t edge = bytes[kPulseEdgeAt];
  if ((edge != 'a' && edge != 'c') || read_le<std::uint32_t>(bytes, kZeroAt) != 0) return std::nullopt;
  const auto time_ns = read_le<std::int64_t>(bytes, kPulseTimeAt);
  const auto wall_ns = read_le<std::int64_t>(bytes, kPulseWallAt);
  if (!is_instant(time_ns) || !is_instant(wall_ns)) return std::nullopt;
  return UtcPulse{edge == 'a' ? PulseEdge::kAssert : PulseEdge::kClear,
                  read_le<std::uint32_t>(bytes, kPulseSequenceAt), host_time_from_ns(time_ns),
                  utc_time_from_ns(wall_ns), Duration{read_le<std::uint32_t>(bytes, kPulseApartAt)}};
}

}  // namespace imuscope
