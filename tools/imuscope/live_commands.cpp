/// The commands of the package imuscope-live: what a vehicle needs.

#include "commands.h"

namespace imuscope::cli {

void add_commands(CLI::App& app, Work& work) {
  add_run(app, work, nullptr);
  add_replay(app, work);
  add_care_commands(app, work);
}

std::vector<std::string> commands_of_another_package() {
  return {"wv",       "fit",    "characterize", "correlate", "compare", "export", "process", "combine",
          "evaluate", "report", "tables",       "fleet",     "decode",  "import", "view"};
}

}  // namespace imuscope::cli
