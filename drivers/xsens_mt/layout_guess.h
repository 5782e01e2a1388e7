#pragma once

/// Legacy data without a Configuration message in the stream does not say what it holds. What it holds can be
/// guessed: of all layouts of the right length, the one whose numbers make sense (counters count, quaternions
/// have length one, forces are those of a vehicle). For looking at recordings; a driver is told its layout.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/xsens_mt/mtdata.h"

namespace imuscope::xsens {

/// @param messages  data of MTData messages in stream order, all of one length; some tens are enough
/// @return nothing where no layout makes sense
std::optional<DataLayout> guess_layout(const std::vector<std::span<const std::uint8_t>>& messages);

}  // namespace imuscope::xsens
