#pragma once

/// The files of a run folder as messages in the order of their times.

#include <filesystem>
#include <memory>

#include "view/recorded_messages.h"

namespace imuscope::view {

/// @return an error of kind kWork for a folder without navigation.csv that can be read
[[nodiscard]] Result<std::unique_ptr<RecordedMessages>> open_run_folder(const std::filesystem::path& folder);

}  // namespace imuscope::view
