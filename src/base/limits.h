#pragma once

/// How much there may be of everything, and for how long one part may stand still before another loses
/// something. Capacities follow from rates and stalls; what depends on each other is bound together here.

#include <algorithm>
#include <bit>
#include <cstddef>

namespace imuscope {

/// Most S-IMUs that one run can hold, and beside them the R-IMU, a GNSS receiver and an odometry device.
inline constexpr std::size_t kMaxSImus = 6;
inline constexpr std::size_t kMaxDevices = kMaxSImus + 3;
/// Fastest samples that a device may be configured to send.
inline constexpr double kMaxRate_hz = 2000.0;
/// What most IMUs send; stalls may last longer then.
inline constexpr double kCommonRate_hz = 100.0;

/// Places of a ring that takes `rate_hz` elements a second while its consumer stands still.
[[nodiscard]] constexpr std::size_t ring_capacity(double rate_hz, double stall_s) noexcept {
  const double elements = rate_hz * stall_s;
  const auto whole = static_cast<std::size_t>(elements);
  return std::bit_ceil(static_cast<double>(whole) < elements ? whole + 1 : whole);
}

/// The whole service, or one of its core threads, may stand still for this long without a sample being lost
/// here; what the kernel has no room for meanwhile is lost there.
inline constexpr double kLongestStall_s = 120.0;
/// That long up to this rate of samples; above it as long as the largest ring lasts.
inline constexpr double kLongestStallRate_hz = 500.0;
/// A reference sends its attitude as a sample of its own.
inline constexpr double kSamplesPerMessage = 2.0;
/// Samples of one device on their way to the core.
inline constexpr std::size_t kSampleRingMin = 1024;
inline constexpr std::size_t kSampleRingMax = ring_capacity(kLongestStallRate_hz, kLongestStall_s);
[[nodiscard]] constexpr std::size_t sample_ring_capacity(double rate_hz) noexcept {
  return std::clamp(ring_capacity(kSamplesPerMessage * rate_hz, kLongestStall_s), kSampleRingMin,
                    kSampleRingMax);
}
static_assert(sample_ring_capacity(kCommonRate_hz) >=
              static_cast<std::size_t>(kSamplesPerMessage * kCommonRate_hz * kLongestStall_s));
static_assert(kSampleRingMax >= ring_capacity(kMaxRate_hz, 30.0), "half a minute at the highest rate");

/// A core that finds the reference this far behind the cut catches up in steps.
inline constexpr double kBehind_s = 1.0;
/// Of time of validity that one tick of a core that catches up takes: ten times as much as passes meanwhile.
inline constexpr double kCatchUpStep_s = 0.1;
/// So close to the cut it is up to date.
inline constexpr double kCaughtUp_s = 0.3;
/// Time of validity that one tick can meet at most.
inline constexpr double kCoreStall_s = kBehind_s;
static_assert(kCaughtUp_s + kCatchUpStep_s <= kCoreStall_s);
/// S samples that one tick can show.
inline constexpr std::size_t kEpochsPerTick =
    kMaxSImus * static_cast<std::size_t>(kMaxRate_hz * kCoreStall_s);

/// An S sample waits at most this long for the reference at its instant.
inline constexpr double kReferenceWait_s = 0.1;
/// S samples of one sensor that wait for the reference: as long as its line may stand still alone.
inline constexpr std::size_t kWaitingSamplesMin = ring_capacity(kMaxRate_hz, 2.0);
static_assert(kWaitingSamplesMin >= ring_capacity(kMaxRate_hz, kCoreStall_s + kReferenceWait_s));
[[nodiscard]] constexpr std::size_t waiting_samples_capacity(double rate_hz) noexcept {
  return std::clamp(ring_capacity(rate_hz, kLongestStall_s), kWaitingSamplesMin, kSampleRingMax);
}

/// Samples of the reference that are kept for an S-IMU whose line stood still alone.
[[nodiscard]] constexpr std::size_t reference_window_capacity(double rate_hz) noexcept {
  return waiting_samples_capacity(rate_hz);
}
/// Past of the reference that an S-IMU whose mounting is not known yet, or a GNSS solution, is held against:
/// places at its rate.
inline constexpr double kReferencePast_s = 2.5;
inline constexpr std::size_t kReferencePastMin = 256;
[[nodiscard]] constexpr std::size_t reference_past_capacity(double rate_hz) noexcept {
  return std::max(kReferencePastMin, ring_capacity(rate_hz, kReferencePast_s));
}
static_assert(kReferencePast_s >= kCoreStall_s + kReferenceWait_s);
static_assert(kBehind_s > kCatchUpStep_s + kReferenceWait_s,
              "the reference runs ahead by as long as S samples wait");

/// The publisher writes files, whose disk may stand still: for this long at the common rate.
inline constexpr double kPublisherStall_s = 6.0;
/// Rows of the error process on their way to the publisher: of a stall, and all of a tick that catches up.
inline constexpr std::size_t kErrorRingCapacity =
    std::max(ring_capacity(static_cast<double>(kMaxSImus) * kCommonRate_hz, kPublisherStall_s),
             std::bit_ceil(kEpochsPerTick));
inline constexpr double kSnapshotRate_hz = 10.0;
inline constexpr std::size_t kSnapshotRingCapacity = ring_capacity(kSnapshotRate_hz, kPublisherStall_s);
/// Events and new noise models come one by one: a few a minute, and what a tick may tell at most.
inline constexpr std::size_t kEventsPerTick = 64;
inline constexpr std::size_t kEventRingCapacity = 4 * kEventsPerTick;
inline constexpr std::size_t kAppliedNoiseRingCapacity = 16;
static_assert(kAppliedNoiseRingCapacity >= 2 * kMaxSImus);
/// History of the filter on its way to the live smoother.
inline constexpr double kHistoryRate_hz = 5.0;
inline constexpr std::size_t kHistoryRingCapacity = ring_capacity(kHistoryRate_hz, 3.0);

/// Serial lines are read once a tick.
inline constexpr double kReadRate_hz = 100.0;
/// The recorder's disk may stand still for so long before a read is lost (capture/raw_chunk.h).
inline constexpr double kRecordStall_s = 60.0;
inline constexpr std::size_t kRawRingBytesMin = std::size_t{1} << 20U;
/// Bounds the memory that is locked; only rates that no serial line carries get there.
inline constexpr std::size_t kRawRingBytesMax = std::size_t{64} << 20U;
/// Blocks of rows on their way to the modeller, which runs when nothing else wants to: on a busy PC a fit of every
/// S-IMU takes minutes.
inline constexpr double kModellerStall_s = 300.0;
inline constexpr std::size_t kRowsPerModellerBlock = 64;
inline constexpr std::size_t kModellerBlocks = ring_capacity(
    static_cast<double>(kMaxSImus) * kCommonRate_hz / static_cast<double>(kRowsPerModellerBlock),
    kModellerStall_s);
static_assert(kModellerBlocks * kRowsPerModellerBlock >=
                  kMaxSImus * static_cast<std::size_t>(kMaxRate_hz * 20.0),
              "twenty seconds at the highest rate");
/// What breaks the rule of the ticks: every sample of a stall at the highest rate of one device.
inline constexpr std::size_t kExceptionRingCapacity = ring_capacity(kMaxRate_hz, kCoreStall_s);

}  // namespace imuscope
