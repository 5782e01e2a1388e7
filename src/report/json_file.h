#pragma once

/// JSON documents of a run, or of somebody else who says so.

#include <filesystem>
#include <nlohmann/json.hpp>

namespace imuscope::report {

/// The document in a file; discarded (is_discarded()) where it cannot be read, is no JSON, or is larger than
/// any that a run writes (kTextFileMax): what is made of a file must not take more memory than there is.
[[nodiscard]] nlohmann::json read_json_file(const std::filesystem::path& file);

}  // namespace imuscope::report
