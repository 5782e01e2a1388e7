#pragma once

/// A page as a PDF, as a browser prints it.

#include <filesystem>
#include <string>

#include "base/output_folder.h"
#include "base/result.h"

namespace imuscope::page {

/// Prints the page `html_name` of `folder` into a PDF of the same name beside it, and returns its path. Takes
/// some seconds, in which Chromium (chromium-headless-shell, or chromium where that is not there) reads the page
/// and nothing else. Errors (kWork): neither is installed, it did not end within two minutes, or printed nothing.
Result<std::filesystem::path> print_page(const OutputFolder& folder, const std::string& html_name);

}  // namespace imuscope::page
