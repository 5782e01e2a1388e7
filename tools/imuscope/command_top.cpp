#include <fmt/format.h>
#include <unistd.h>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <imuscope/event_t.hpp>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "commands.h"
#include "print.h"
#include "publish/lcm_listener.h"
#include "publish/lcm_publisher.h"
#include "publish/message_codec.h"
#include "publish/message_values.h"
#include "rt/host_clock.h"
#include "tools/imuscope/top/terminal.h"
#include "tools/imuscope/top/view.h"

namespace imuscope::cli {

namespace {

using std::chrono::milliseconds;

// A signal handler may only set a lock-free flag.
std::atomic<bool> top_stopped{false};  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)
extern "C" void stop_top(int) { top_stopped.store(true); }

constexpr auto kRedraw = milliseconds(200);
/// STATUS comes once a second; a service that is slow to answer gets a few.
constexpr double kDefaultWait_s = 5.0;

struct TopCommand {
  std::string url{kDefaultLcmUrl};
  std::string prefix{kDefaultChannelPrefix};
  std::string event;
  double wait_s = kDefaultWait_s;
  bool once = false;
  bool json = false;
};

/// Keeps the newest message of each S-IMU. A network may name more than there can be: those are left out.
template <typename Message>
void keep(std::map<std::string, Message>& by_name, Message message) {
  constexpr std::size_t kNamesMax = 64;
  if (by_name.size() < kNamesMax || by_name.contains(message.name))
    by_name.insert_or_assign(message.name, std::move(message));
}

class Top {
 public:
  Top(LcmListener ear, LcmPublisher voice) : ear_(std::move(ear)), voice_(std::move(voice)) {
    std::array<char, 256> name{};
    (void)gethostname(name.data(), name.size() - 1);
    source_ = fmt::format("imuscope top on {}", name.data());
  }

  Result<void> listen() {
    const auto keep_status = [this](const auto&, auto bytes) {
      if (auto status = decode_message<status_t>(bytes)) {
        heard_.status = std::move(*status);
        heard_at_ = host_now();
      } else {
        heard_.note = "a STATUS message of another version was heard: use the imuscope of that PC";
      }
    };
    const auto keep_calibration = [this](const auto&, auto bytes) {
      if (auto message = decode_message<calibration_t>(bytes)) keep(heard_.calibrations, std::move(*message));
    };
    const auto keep_odometry = [this](const auto&, auto bytes) {
      if (auto message = decode_message<odometry_t>(bytes)) heard_.odometry = *message;
    };
    const auto keep_virtual_imu = [this](const auto&, auto bytes) {
      auto message = decode_message<virtual_imu_t>(bytes);
      if (!message) return;
      heard_.virtual_imu = std::move(*message);
      virtual_imu_heard_at_ = host_now();
    };
    const auto keep_model = [this](const auto&, auto bytes) {
      if (auto message = decode_message<noise_model_t>(bytes)) keep(heard_.models, std::move(*message));
    };
    return ear_.subscribe("STATUS", keep_status)
        .and_then([&] { return ear_.subscribe("CALIBRATION_.*", keep_calibration); })
        .and_then([&] { return ear_.subscribe("ODOMETRY", keep_odometry); })
        .and_then([&] { return ear_.subscribe("VIRTUAL", keep_virtual_imu); })
        .and_then([&] { return ear_.subscribe("NOISE_MODEL_.*", keep_model); });
  }

  void mark(const std::string& text) {
    event_t event{};
    event.utime = to_utime(wall_clock_now());
    event.source = source_;
    event.text = text;
    voice_.publish(event, "EVENT");
    heard_.note = fmt::format("event sent: {}", text);
  }

  /// Waits for one STATUS and prints it.
  Result<void> print_once(double wait_s, bool as_json) {
    const HostTime end = host_now() + from_seconds(wait_s);
    while (!heard_.status && host_now() < end && !top_stopped.load()) (void)ear_.wait(kRedraw);
    if (!heard_.status) {
      return work_error(fmt::format("no service was heard within {:g} s{}", wait_s,
                                    heard_.note.empty() ? "" : "; " + heard_.note),
                        "start `imuscope run`, and give the --lcm URL and --prefix of its configuration; "
                        "from another PC its ttl must be 1");
    }
    if (as_json) {
      say("{}\n", top::json_of(heard_));
    } else {
      top::print(top::lines_of(heard_));
    }
    return {};
  }

  void watch() {
    top::Terminal terminal;
    bool over = false;
    while (!over && !top_stopped.load()) {
      (void)ear_.wait(kRedraw);
      while (const auto key = terminal.key()) over = press(*key) || over;
      const HostTime now = host_now();
      if (heard_.status) heard_.status_age_s = to_seconds(now - heard_at_);
      if (heard_.virtual_imu) heard_.virtual_imu_age_s = to_seconds(now - virtual_imu_heard_at_);
      auto lines = top::lines_of(heard_);
      lines.push_back(typing_ ? fmt::format("event: {}_   (Enter sends, Esc forgets)", typed_)
                              : "e: mark an event   q: quit");
      terminal.draw(lines);
    }
  }

 private:
  /// Returns whether the key ends the program.
  bool press(char key) {
    constexpr char kEscape = '\033';
    constexpr char kDelete = '\177';
    constexpr std::size_t kLongest = 200;
    if (!typing_) {
      if (key == 'e') {
        typing_ = true;
        typed_.clear();
      }
      return key == 'q';
    }
    if (key == '\n' || key == '\r') {
      mark(typed_.empty() ? "mark" : typed_);
      typing_ = false;
    } else if (key == kEscape) {
      typing_ = false;
    } else if (key == kDelete || key == '\b') {
      if (!typed_.empty()) typed_.pop_back();
    } else if (typed_.size() < kLongest) {
      typed_ += key;
    }
    return false;
  }

  LcmListener ear_;
  LcmPublisher voice_;
  std::string source_;
  top::Heard heard_;
  HostTime heard_at_{};
  HostTime virtual_imu_heard_at_{};
  bool typing_ = false;
  std::string typed_;
};

Result<void> run(const TopCommand& options) {
  auto ear = LcmListener::open(options.url, options.prefix);
  if (!ear) return tl::unexpected<Error>(ear.error());
  auto voice = LcmPublisher::open(options.url, options.prefix);
  if (!voice) return tl::unexpected<Error>(voice.error());
  std::signal(SIGINT, stop_top);
  std::signal(SIGTERM, stop_top);
  Top top(std::move(*ear), std::move(*voice));
  if (auto listening = top.listen(); !listening) return listening;
  if (!options.event.empty()) {
    top.mark(options.event);
    return {};
  }
  if (options.once || options.json || isatty(STDIN_FILENO) == 0 || isatty(STDOUT_FILENO) == 0) {
    return top.print_once(options.wait_s, options.json);
  }
  top.watch();
  return {};
}

}  // namespace

void add_top(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("top", "A running service in the terminal, heard over LCM; e marks an event");
  auto options = std::make_shared<TopCommand>();
  command->add_option("--lcm", options->url, "the bus to listen to")->capture_default_str()->type_name("URL");
  command->add_option("--prefix", options->prefix, "of the channels")
      ->capture_default_str()
      ->type_name("WORD");
  command->add_option("--event", options->event, "mark an event with this text, and end")->type_name("TEXT");
  command->add_flag("--once", options->once, "print once and end (always so where there is no terminal)");
  command->add_option("--wait", options->wait_s, "seconds to wait for the service, with --once")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->add_flag("--json", options->json, "print once as JSON and end");
  on_chosen(*command, chosen, [options] { return run(*options); });
}

}  // namespace imuscope::cli
