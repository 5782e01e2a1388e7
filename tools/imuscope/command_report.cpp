#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "base/output_folder.h"
#include "commands.h"
#include "findings.h"
#include "print.h"
#include "progress.h"
#include "results/page/printed_page.h"
#include "results/report/comparison_page.h"
#include "results/report/paper_figures.h"
#include "results/report/report.h"

namespace imuscope::cli {

namespace {

struct ReportCommand {
  std::vector<std::filesystem::path> runs;
  std::filesystem::path out = "comparison.html";
  bool figures = false;
  bool pdf = false;
  bool force = false;
};

/// Two runs as one page. What stands in its place already is somebody's.
Result<void> compare_runs(const ReportCommand& options) {
  if (std::filesystem::exists(options.out) && !options.force) {
    return usage_error(fmt::format("{} exists", options.out.string()),
                       "give another --out, or --force to write over it");
  }
  const auto comparison = comparison_page(options.runs[0], options.runs[1]);
  if (!comparison) return tl::unexpected<Error>(comparison.error());
  const auto parent = options.out.has_parent_path() ? options.out.parent_path() : std::filesystem::path(".");
  const auto folder = OutputFolder::open(parent);
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (auto written = folder->write_whole(options.out.filename().string(), *comparison); !written)
    return written;
  say("{}\n", options.out.string());
  return {};
}

Result<void> report_of_run(const ReportCommand& options) {
  const auto& run_dir = options.runs.front();
  if (auto looked = look_at_live_run(run_dir); !looked) return looked;
  if (auto written = write_report(run_dir); !written) return written;
  say("{}\n", (run_dir / "report.html").string());
  if (options.pdf) {
    const auto folder = OutputFolder::open(run_dir);
    if (!folder) return tl::unexpected<Error>(folder.error());
    ProgressBar bar;
    bar.show("printing");
    const auto printed = page::print_page(*folder, "report.html");
    bar.clear();
    if (!printed) return tl::unexpected<Error>(printed.error());
    say("{}\n", printed->string());
  }
  if (!options.figures) return {};
  ProgressBar bar;
  bar.show("drawing");
  const auto drawn = write_figures(run_dir);
  bar.clear();
  if (!drawn) return tl::unexpected<Error>(drawn.error());
  for (const auto& file : *drawn) say("{}\n", file.string());
  return {};
}

}  // namespace

void add_report(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "report", "Write report.html from the files of a run folder; of two, a page with both side by side");
  auto options = std::make_shared<ReportCommand>();
  command->add_option("RUN_DIR", options->runs, "folder that a run wrote with --out; two to compare them")
      ->required()
      ->expected(1, 2);
  command->add_option("--out,-o", options->out, "page of the comparison (comparison.html)")
      ->type_name("FILE");
  command->add_flag("--figures", options->figures,
                    "draw the figures as SVG and PDF for papers, too (RUN_DIR/figures)");
  command->add_flag("--pdf", options->pdf,
                    "print it as report.pdf, too, by Chromium: eight pages, and an appendix");
  command->add_flag("--force", options->force, "write over a file that is there");
  on_chosen(*command, chosen, [options]() -> Result<void> {
    return options->runs.size() == 2 ? compare_runs(*options) : report_of_run(*options);
  });
}

}  // namespace imuscope::cli
