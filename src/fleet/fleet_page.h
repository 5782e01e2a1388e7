#pragma once

/// The page of a fleet: one HTML file that carries all it shows and loads nothing, made from the catalogue
/// alone.

#include <filesystem>
#include <string>

#include "base/result.h"

namespace imuscope::fleet {

/// Writes OUT/fleet.html and returns its path. Errors: there is no catalogue (kUsage), or it is none of ours
/// (kWork).
Result<std::filesystem::path> write_fleet_page(const std::filesystem::path& out, const std::string& name);

}  // namespace imuscope::fleet
