#pragma once

/// What a capture lacks, for people.

#include <string>
#include <vector>

#include "capture/capture_reader.h"

namespace imuscope {

/// What is missing of a capture or damaged, and what that costs, in sentences; none where it is whole.
/// @param input  as the capture was named
[[nodiscard]] std::vector<std::string> damage_of(const CaptureSummary& summary, const std::string& input);

}  // namespace imuscope
