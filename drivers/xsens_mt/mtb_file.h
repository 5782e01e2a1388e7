#pragma once

/// The manufacturer's log files (.mtb): a header of no published layout, then the device's bytes as they
/// came.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace imuscope::xsens {

/// Where the device's bytes begin: at the first of kChainedFrames frames that follow one another without a
/// gap. A frame that a checksum of 8 bits finds in the header by chance is followed by none.
/// @param beginning  of the file; a megabyte is more than any header
/// @return nothing where no such place is in it
[[nodiscard]] std::optional<std::size_t> data_offset_of_mtb(std::span<const std::uint8_t> beginning) noexcept;

inline constexpr int kChainedFrames = 3;

}  // namespace imuscope::xsens
