#pragma once

/// Two runs side by side as a page: verdicts, mountings and how far apart they are, noise, devices.

#include <filesystem>
#include <string>

#include "base/result.h"

namespace imuscope {

/// The page of two run folders, which needs nothing from outside of it. Errors as write_report().
Result<std::string> comparison_page(const std::filesystem::path& first, const std::filesystem::path& second);

}  // namespace imuscope
