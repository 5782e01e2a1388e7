#pragma once

/// What makes two tasks the same: SHA-256 of everything that their results depend on.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope::fleet {

/// 64 hexadecimal digits.
std::string sha256_of(std::string_view content);

/// Of the files' contents, one after the other with their sizes between them; read in blocks. Errors: kWork,
/// the file that cannot be read.
Result<std::string> sha256_of_files(const std::vector<std::filesystem::path>& files);

/// "VERSION+12 hexadecimal digits of the program's own file": two builds of one version are two programs.
std::string program_identity(std::string_view version);

/// Of the parts, each after its size; 24 digits name a folder, and two of a million captures share one with
/// a chance of 1e-17.
std::string key_of(const std::vector<std::string>& parts);

}  // namespace imuscope::fleet
