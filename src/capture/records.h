#pragma once

/// What a capture holds, as plain values.

#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "base/limits.h"
#include "base/time.h"
#include "capture/raw_chunk.h"
#include "rt/spsc_ring.h"
#include "sample/sample.h"

namespace imuscope {

inline constexpr int kCaptureFormat = 1;

/// What was run; a replay needs no other file.
struct RunHeader {
  std::string name;     ///< of the run
  std::string version;  ///< of the program that recorded
  std::string build;    ///< compiler and options
  std::string processor;
  HostTime t0{};              ///< cut of tick 0
  Duration period{0};         ///< between ticks
  UtcTime t0_wall{};          ///< the PC's wall clock at t0
  std::string configuration;  ///< text of the configuration file
  std::string configuration_hash;
  std::vector<std::string> devices;  ///< names, in configuration order: DeviceIndex counts here
};

/// One read or write, whole again; or the rate at which the line runs from then on.
struct RawRead {
  std::string device;
  Direction direction = Direction::kRead;
  HostTime arrival{};
  std::vector<std::uint8_t> bytes;
  std::optional<HostTime> received{};  ///< its last byte had come, where the kernel or the card said so
};

/// What breaks the rule "tick k consumes what arrived at or before its cut" in a live run.
enum class ExceptionKind : std::uint8_t {
  kLateSample,     ///< consumed by `tick`, though an earlier tick's cut was after its arrival
  kRefusedSample,  ///< found the ring full: never consumed
  kSkippedTicks,   ///< `count` ticks before `tick` were not run
};

/// Crosses a ring from the core to the recorder.
struct RunException {
  ExceptionKind kind;
  DeviceIndex device;            ///< not with kSkippedTicks
  std::int64_t sample_sequence;  ///< of the sample concerned; -1 where none is
  std::int64_t tick;             ///< -1 where none is
  std::int64_t count;
};
static_assert(std::is_trivially_copyable_v<RunException>);

using ExceptionRing = SpscRing<RunException, kExceptionRingCapacity>;

}  // namespace imuscope
