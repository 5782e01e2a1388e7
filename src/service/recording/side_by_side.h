#pragma once

/// What may be done at once: as much as oneTBB may, which --threads limits.

#include "service/recording/byte_source.h"

namespace imuscope {

/// Whether more than one thread may be used.
[[nodiscard]] bool may_use_threads();

/// Whether more than two may.
[[nodiscard]] bool may_use_third_thread();

/// How a pass over a recording reads it: ahead of those who use it, where more than one thread may be used.
[[nodiscard]] Reading reading_by_threads();

}  // namespace imuscope
