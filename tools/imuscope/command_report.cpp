#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "commands.h"
#include "print.h"
#include "report/paper_figures.h"
#include "report/report.h"

namespace imuscope::cli {

void add_report(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("report", "Write report.html from the files of a run folder");
  auto run_dir = std::make_shared<std::filesystem::path>();
  command->add_option("RUN_DIR", *run_dir, "Folder that a run wrote with --out")->required();
  auto figures = std::make_shared<bool>(false);
  command->add_flag("--figures", *figures,
                    "draw the figures as SVG and PDF for papers, too (RUN_DIR/figures)");
  on_chosen(*command, chosen, [run_dir, figures]() -> Result<void> {
    if (auto written = write_report(*run_dir); !written) return written;
    say("{}\n", (*run_dir / "report.html").string());
    if (!*figures) return {};
    const auto drawn = write_figures(*run_dir);
    if (!drawn) return tl::unexpected<Error>(drawn.error());
    for (const auto& file : *drawn) say("{}\n", file.string());
    return {};
  });
}

}  // namespace imuscope::cli
