#include "view/recorded_view.h"

#include <chrono>
#include <string_view>
#include <thread>
#include <utility>

#include "view/page.h"
#include "view/player.h"

namespace imuscope::view {

namespace {

using std::chrono::steady_clock;

constexpr auto kTurnEvery = std::chrono::milliseconds(100);

}  // namespace

Result<void> show_recording(const std::filesystem::path& recording, const ViewDoor& door,
                            const std::function<void(const ViewServer&)>& opened,
                            const std::atomic<bool>& stopped) {
  auto messages = open_recording(recording);
  if (!messages) return tl::unexpected<Error>(messages.error());
  auto player = Player::open(std::move(*messages));
  if (!player) return tl::unexpected<Error>(player.error());
  auto server = ViewServer::open(
      door, page_html(), [&player] { return (*player)->whole(); },
      [&player](std::string_view text) { (*player)->on_said(text); });
  if (!server) return tl::unexpected<Error>(server.error());
  opened(**server);
  auto last = steady_clock::now();
  while (!stopped.load()) {
    std::this_thread::sleep_until(last + kTurnEvery);
    const auto now = steady_clock::now();
    // A PC that slept does not jump ahead.
    const double passed_s =
        std::chrono::duration<double>(std::min<steady_clock::duration>(now - last, 10 * kTurnEvery)).count();
    last = now;
    std::string part = (*player)->turn(passed_s);
    if (!part.empty()) (*server)->send(std::move(part));
  }
  return {};
}

}  // namespace imuscope::view
