#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "commands.h"
#include "report/report.h"

namespace imuscope::cli {

void add_report(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("report", "Write report.html from the files of a run folder");
  auto run_dir = std::make_shared<std::filesystem::path>();
  command->add_option("RUN_DIR", *run_dir, "Folder that a run wrote with --out")->required();
  on_chosen(*command, chosen, [run_dir]() -> Result<void> {
    if (auto written = write_report(*run_dir); !written) return written;
    fmt::print("{}\n", (*run_dir / "report.html").string());
    return {};
  });
}

}  // namespace imuscope::cli
