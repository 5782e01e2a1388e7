#pragma once

/// Reads a fault script: what goes wrong in a simulated run, and when. TOML, one [[fault]] table for each:
///
///   [[fault]]
///   kind = "unplug"           # see below
///   device = "mtx1"           # or a list of names; every device where it is absent
///   at_s = 120.0              # scenario time
///   for_s = 5.0               # to the end where it is absent
///
// clang-format off
/// | kind | further keys | what happens |
/// |---|---|---|
/// | "flip" | share (of bytes) | one bit of a byte turns |
/// | "drop" | share (of bytes) | bytes are lost |
/// | "duplicate" | share (of messages) | messages come twice |
/// | "cut" | share (of messages) | messages lose their tail |
/// | "garbage" | share (of messages) | 1 to 64 random bytes follow a message |
/// | "stall" |  | the host reads nothing, then all at once |
/// | "burst" | every_s | the host reads only that often |
/// | "clock_skew" | ppm | the device's clock runs faster |
/// | "clock_jump" | by_s | its count or time tag jumps, once |
/// | "restart" |  | without power for for_s, then it boots |
/// | "unplug" |  | its port is gone for for_s; it runs on |
/// | "missing" | blocks (names of the device's blocks) | its messages lack them |
/// | "stuck" | sensors ("gyro", "accel", "both") | they repeat their last value |
/// | "saturation" | gyro_range_deg_per_s, accel_range_mps2 | they show no more than that |
/// | "rtk_jump" | by_n_m (north, east, down) | the receiver's position is wrong, and sure |
/// | "solution" | type ("none", "single", "differential", "float", "fixed") | its solution is of that type |
// clang-format on
///
/// A share is a probability, from 0 to 1.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "firmware_sim/imusim/configuration.h"
#include "firmware_sim/imusim/failure.h"

namespace imusim {

/// The word for a kind in a fault script.
std::string_view name_of(FaultKind kind);

/// Reads a script and puts its faults into the configuration; refuses devices and keys that do not exist,
/// with file and line.
Outcome<void> load_faults(const std::filesystem::path& file, Configuration& configuration);

/// The same for a text; `file` stands for it in messages.
Outcome<void> parse_faults(const std::string& text, const std::filesystem::path& file,
                           Configuration& configuration);

}  // namespace imusim
