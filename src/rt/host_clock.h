#pragma once

/// Reads the PC's clocks. For I/O threads, the periodic loop and non-real-time threads; the estimator is
/// handed its time (base/time.h).

#include "base/time.h"

namespace imuscope {

/// CLOCK_MONOTONIC now.
[[nodiscard]] HostTime host_now() noexcept;

/// CLOCK_REALTIME now, as the PC believes it to be. For labels (log records, file names) until a device has
/// told UTC; never for computing.
[[nodiscard]] UtcTime wall_clock_now() noexcept;

}  // namespace imuscope
