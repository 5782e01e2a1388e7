#pragma once

/// A running service in the browser: heard over LCM, shown to every page, and marks of people sent to it.

#include <atomic>
#include <functional>
#include <string>

#include "base/result.h"
#include "publish/channel_name.h"
#include "publish/lcm_url.h"
#include "view/view_server.h"

namespace imuscope::view {

struct LiveSource {
  std::string url{kDefaultLcmUrl};
  std::string prefix{kDefaultChannelPrefix};
};

/// Shows until `stopped`. A service may end, begin anew or not be there yet.
/// @param opened  is told when the page can be asked for
/// @return the errors of the bus and of ViewServer::open()
[[nodiscard]] Result<void> show_live(const LiveSource& source, const ViewDoor& door,
                                     const std::function<void(const ViewServer&)>& opened,
                                     const std::atomic<bool>& stopped);

}  // namespace imuscope::view
