#pragma once

/// Chunks packed by bzip2.

#include <string>

#include "logs/mcap/records.h"

namespace imuscope::rosbag {

/// Unpacks into `out` what there is, up to `size` bytes and never more.
/// @return whether all `size` bytes came
bool bunzip(mcap::Bytes packed, std::size_t size, std::string& out);

}  // namespace imuscope::rosbag
