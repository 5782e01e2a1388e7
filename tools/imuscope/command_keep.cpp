#include <memory>
#include <string>
#include <vector>

#include "base/text.h"
#include "commands.h"
#include "print.h"
#include "service/live/retention.h"

namespace imuscope::cli {

namespace {

struct KeepCommand {
  std::vector<std::string> runs;
  bool undo = false;
};

Result<void> run(const KeepCommand& options) {
  for (const auto& folder : options.runs) {
    if (auto marked = set_kept(folder, !options.undo); !marked) return marked;
    say("{}: {}\n", one_line(folder), options.undo ? "may be removed again" : "kept");
  }
  return {};
}

}  // namespace

void add_keep(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("keep", "Marks runs that the service must never remove ([record])");
  auto options = std::make_shared<KeepCommand>();
  command->add_option("run", options->runs, "folders of runs")->required()->type_name("RUN_DIR");
  command->add_flag("--undo", options->undo, "take the mark away");
  on_chosen(*command, chosen, [options] { return run(*options); });
}

}  // namespace imuscope::cli
