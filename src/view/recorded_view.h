#pragma once

/// A recording in the browser: played, paused and sought in, the same for every page.

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "base/result.h"
#include "view/view_server.h"

namespace imuscope::view {

/// Reads the recording once, then plays it until `stopped`.
/// @param opened  is told when the page can be asked for
/// @return the errors of open_recording() and ViewServer::open(), and of kind kWork for a recording that
/// holds nothing a page shows
[[nodiscard]] Result<void> show_recording(const std::filesystem::path& recording, const ViewDoor& door,
                                          const std::function<void(const ViewServer&)>& opened,
                                          const std::atomic<bool>& stopped);

}  // namespace imuscope::view
