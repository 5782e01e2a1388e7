#include "view/live_view.h"

#include <fmt/format.h>
#include <unistd.h>
#include <array>
#include <chrono>
#include <imuscope/event_t.hpp>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/time.h"
#include "publish/lcm_listener.h"
#include "publish/lcm_publisher.h"
#include "publish/message_values.h"
#include "rt/host_clock.h"
#include "view/page.h"
#include "view/page_command.h"
#include "view/picture.h"

namespace imuscope::view {

namespace {

using std::chrono::milliseconds;

/// Between two parts for the pages.
constexpr auto kPartEvery = milliseconds(100);
/// A part without news tells that this program lives, and how long the service has been silent.
constexpr auto kSignOfLifeEvery = milliseconds(1000);
/// As many marks as the service takes (service/live/event_gate.h): two a second, twenty at once.
constexpr double kMarksPerSecond = 2.0;
constexpr double kMarksAtOnce = 20.0;

class Live {
 public:
  Live(LcmListener ear, LcmPublisher voice) : ear_(std::move(ear)), voice_(std::move(voice)) {
    std::array<char, 256> name{};
    (void)gethostname(name.data(), name.size() - 1);
    source_ = fmt::format("imuscope view on {}", name.data());
  }

  Result<void> listen() {
    const auto hear = [this](const std::string& /*channel*/, std::span<const std::uint8_t> bytes) {
      const std::scoped_lock lock(mutex_);
      if (picture_.hear(bytes)) heard_at_ = host_now();
    };
    for (const char* kind : {"STATUS", "NAVIGATION", "ODOMETRY", "CALIBRATION_.*", "ERROR_.*", "WV_.*",
                             "NOISE_MODEL_.*", "EVENT"}) {
      if (auto heard = ear_.subscribe(kind, hear); !heard) return heard;
    }
    return {};
  }

  std::string whole() {
    const std::scoped_lock lock(mutex_);
    return picture_.whole(extra());
  }

  void on_said(std::string_view text) {
    const auto command = read_page_command(text);
    if (!command) return;
    if (const auto* mark = std::get_if<Mark>(&*command)) {
      const std::scoped_lock lock(mutex_);
      const HostTime now = host_now();
      tokens_ = std::min(kMarksAtOnce, tokens_ + kMarksPerSecond * to_seconds(now - refilled_));
      refilled_ = now;
      if (tokens_ < 1.0) return;
      tokens_ -= 1.0;
      marks_.push_back(mark->text);
    }
  }

  void watch(ViewServer& server, const std::atomic<bool>& stopped) {
    HostTime next = host_now();
    HostTime last = next;
    while (!stopped.load()) {
      (void)ear_.wait(kPartEvery);
      const HostTime now = host_now();
      if (now < next) continue;
      next = now + kPartEvery;
      send_marks();
      const std::scoped_lock lock(mutex_);
      if (!picture_.has_news() && now - last < kSignOfLifeEvery) continue;
      last = now;
      server.send(picture_.part(extra()));
    }
  }

 private:
  /// How old the newest message is; null where there was none.
  [[nodiscard]] std::string extra() const {
    if (!heard_at_) return R"(,"silent_s":null)";
    return fmt::format(R"(,"silent_s":{:.1f})", to_seconds(host_now() - *heard_at_));
  }

  void send_marks() {
    std::vector<std::string> marks;
    {
      const std::scoped_lock lock(mutex_);
      marks.swap(marks_);
    }
    for (const std::string& text : marks) {
      event_t event{};
      event.utime = to_utime(wall_clock_now());
      event.source = source_;
      event.text = text;
      voice_.publish(event, "EVENT");
    }
  }

  LcmListener ear_;
  LcmPublisher voice_;
  std::string source_;
  std::mutex mutex_;  // of what follows: the server's thread asks for the whole picture and brings marks
  Picture picture_;
  std::optional<HostTime> heard_at_;
  std::vector<std::string> marks_;
  double tokens_ = kMarksAtOnce;
  HostTime refilled_ = host_now();
};

}  // namespace

Result<void> show_live(const LiveSource& source, const ViewDoor& door,
                       const std::function<void(const ViewServer&)>& opened,
                       const std::atomic<bool>& stopped) {
  auto ear = LcmListener::open(source.url, source.prefix);
  if (!ear) return tl::unexpected<Error>(ear.error());
  auto voice = LcmPublisher::open(source.url, source.prefix);
  if (!voice) return tl::unexpected<Error>(voice.error());
  Live live(std::move(*ear), std::move(*voice));
  if (auto listening = live.listen(); !listening) return listening;
  auto server = ViewServer::open(
      door, page_html(), [&live] { return live.whole(); },
      [&live](std::string_view text) { live.on_said(text); });
  if (!server) return tl::unexpected<Error>(server.error());
  opened(**server);
  live.watch(**server, stopped);
  return {};
}

}  // namespace imuscope::view
