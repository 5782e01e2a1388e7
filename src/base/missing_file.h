#pragma once

/// Why a file cannot be found, for the person who named it.

#include <string>
#include <system_error>

#include "base/result.h"

namespace imuscope {

/// @param name    of the file, with its kind where that is known: "configuration car.toml"
/// @param why     what std::filesystem::status() said: no such file, or a folder on the way that may not be
///                entered, a name that is too long, a link to itself
/// @param remedy  of a path that leads nowhere
[[nodiscard]] Error explain_missing(const std::string& name, const std::error_code& why,
                                    const std::string& remedy);

}  // namespace imuscope
