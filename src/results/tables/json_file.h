#pragma once

/// JSON documents of a run, or of somebody else who says so.

#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/result.h"

namespace imuscope::tables {

/// Deepest nesting of a document: those of a run have about ten levels.
inline constexpr std::size_t kJsonDepthMax = 64;

/// The document in a file; discarded (is_discarded()) where it cannot be read, is no JSON, is larger than any
/// that a run writes (kTextFileMax) or nested deeper (kJsonDepthMax): what is made of a file must not take
/// more memory than there is, heap or stack.
///
/// Its texts have passed the gate: each is one line (base/text.h, one_line()), but a configuration's, which
/// keeps its lines.
[[nodiscard]] nlohmann::json read_json_file(const std::filesystem::path& file);

/// That a document lacks a field or holds something else there than a run writes, in words for a person.
[[nodiscard]] Error malformed(const std::filesystem::path& run_folder, const nlohmann::json::exception& why);

/// What `work` returns, which takes fields of a run folder's documents for granted; malformed() where one is
/// not there or is of another type.
template <typename Work>
auto with_documents_of(const std::filesystem::path& run_folder, Work&& work) -> decltype(work()) {
  try {
    return work();
  } catch (const nlohmann::json::exception& why) {
    return tl::unexpected<Error>(malformed(run_folder, why));
  }
}

}  // namespace imuscope::tables
