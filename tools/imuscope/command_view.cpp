#include <openssl/rand.h>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>

#include "commands.h"
#include "print.h"
#include "view/live_view.h"
#include "view/recorded_view.h"

namespace imuscope::cli {

namespace {

// A signal handler may only set a lock-free flag.
std::atomic<bool> view_stopped{false};  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)
extern "C" void stop_view(int) { view_stopped.store(true); }

constexpr std::uint16_t kDefaultPort = 8088;

struct ViewCommand {
  std::string recording;
  view::LiveSource source;
  view::ViewDoor door{"127.0.0.1", kDefaultPort, {}};
};

bool is_loopback(const std::string& address) { return address.starts_with("127.") || address == "::1"; }

/// Nobody guesses it: 128 random bits.
Result<std::string> random_token() {
  std::array<unsigned char, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1)
    return work_error("this PC gives no random numbers for a token", "give one with --token");
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

Result<void> run(const ViewCommand& options) {
  view::ViewDoor door = options.door;
  if (door.token.empty() && !is_loopback(door.address)) {
    auto token = random_token();
    if (!token) return tl::unexpected<Error>(token.error());
    door.token = *token;
  }
  std::signal(SIGINT, stop_view);
  std::signal(SIGTERM, stop_view);
  const auto opened = [&door](const view::ViewServer& server) {
    const bool is_ipv6 = door.address.find(':') != std::string::npos;
    say("the page is at http://{}:{}/{}{}\n", is_ipv6 ? "[" + door.address + "]" : door.address,
        server.port(), door.token.empty() ? "" : "?token=", door.token);
    std::fflush(stdout);  // whoever started it waits for this line
  };
  if (!options.recording.empty()) return view::show_recording(options.recording, door, opened, view_stopped);
  return view::show_live(options.source, door, opened, view_stopped);
}

}  // namespace

void add_view(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("view", "A running service or a recording as a page in the browser");
  auto options = std::make_shared<ViewCommand>();
  command->add_option("RECORDING", options->recording,
                      "a run folder or a capture to play; without it, the service that is heard over LCM");
  command->add_option("--port", options->door.port, "of the page")->capture_default_str();
  command
      ->add_option("--address", options->door.address,
                   "of this PC to open the page at; 0.0.0.0 is all of them, for a tablet")
      ->capture_default_str();
  command->add_option("--token", options->door.token,
                      "what a browser has to know; a random one where the page is open beyond this PC");
  command->add_option("--lcm", options->source.url, "the bus to listen to")
      ->capture_default_str()
      ->type_name("URL");
  command->add_option("--prefix", options->source.prefix, "of the channels")
      ->capture_default_str()
      ->type_name("WORD");
  on_chosen(*command, chosen, [options] { return run(*options); });
}

}  // namespace imuscope::cli
