#include <memory>
#include <string>
#include <vector>

#include "commands.h"
#include "print.h"
#include "service/doors/status_socket.h"
#include "tools/imuscope/top/view.h"

namespace imuscope::cli {

namespace {

struct StatusCommand {
  std::string socket;
  bool json = false;
};

Result<void> run(const StatusCommand& options) {
  std::vector<std::filesystem::path> sockets{options.socket};
  if (options.socket.empty()) {
    auto found = find_status_sockets();
    if (!found) return tl::unexpected<Error>(found.error());
    sockets = std::move(*found);
  }
  // A run that was killed may have left its socket beside those that answer.
  bool answered = false;
  Result<void> refused;
  for (const auto& socket : sockets) {
    auto status = ask_status(socket);
    if (!status) {
      refused = tl::unexpected<Error>(status.error());
      continue;
    }
    top::Heard heard;
    heard.status = std::move(status->status);
    heard.status_age_s = status->age_s;
    if (options.json) {
      say("{}\n", top::json_of(heard));
    } else {
      if (answered) say("\n");
      for (const auto& line : top::lines_of(heard)) say("{}\n", line);
    }
    answered = true;
  }
  return answered ? Result<void>{} : refused;
}

}  // namespace

void add_status(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("status", "How the runs on this PC are, asked of themselves, without LCM");
  auto options = std::make_shared<StatusCommand>();
  command->add_option("--socket", options->socket, "of the run to ask (default: all that this user may ask)")
      ->type_name("PATH");
  command->add_flag("--json", options->json, "as JSON, one document for each run");
  on_chosen(*command, chosen, [options] { return run(*options); });
}

}  // namespace imuscope::cli
