#pragma once

/// What a study may do at once.

#include "service/recording/byte_source.h"

namespace imuscope {

/// How a pass over a recording reads it: ahead of the filter, where a study may use more than one thread.
[[nodiscard]] Reading reading_of_study();

}  // namespace imuscope
