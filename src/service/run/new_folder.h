#pragma once

/// The folder of a live run that nobody named.

#include <chrono>
#include <filesystem>
#include <string>

#include "base/result.h"

namespace imuscope {

/// Makes PARENT/NAME-YYYYMMDD-HHMMSS, with "-2", "-3" and so on after it where that is there already: a PC
/// without a battery for its clock begins at the same time again and again, and summer time ends. Missing
/// parents are made.
/// @param name  of the run
/// @param now   of the PC's wall clock; the name shows it in local time
/// @return kUsage for a name that is no folder's ('/' or control characters in it, "." or ".." or none, more
///         than 100 bytes), kWork where the folder cannot be made
[[nodiscard]] Result<std::filesystem::path> make_new_folder(const std::filesystem::path& parent,
                                                            const std::string& name,
                                                            std::chrono::system_clock::time_point now);

}  // namespace imuscope
