#include <fmt/format.h>
#include <tbb/global_control.h>

#include <memory>
#include <optional>

#include "base/json_text.h"
#include "base/text.h"
#include "combination_table.h"
#include "commands.h"
#include "findings.h"
#include "inputs.h"
#include "long_pieces.h"
#include "print.h"
#include "progress.h"
#include "results/report/report.h"
#include "results/tables/json_file.h"
#include "study/several_drives.h"
#include "study/study.h"
#include "study_table.h"

namespace imuscope::cli {

namespace {

/// More do not make a study faster: three S-IMUs have 18 axes.
constexpr int kThreadsMax = 256;

struct ProcessCommand {
  std::vector<std::string> inputs;
  std::string config;
  std::string out;
  std::string labels;
  std::string fix;
  bool json = false;
  bool force = false;
  int threads = 0;  ///< 0: all cores
};

/// Several drives of one mounting: a run folder each, and one mounting of all.
Result<void> process_drives(const ProcessCommand& options,
                            const std::vector<std::vector<std::string>>& inputs) {
  std::vector<OpenedRecording> drives;
  for (const auto& of_drive : inputs) {
    auto opened = open_and_look(of_drive, options.config, options.json);
    if (!opened) return tl::unexpected<Error>(opened.error());
    drives.push_back(std::move(*opened));
  }
  const auto combined = [&] {
    ProgressBar bar;
    StudyRunOptions run;
    run.out = options.out;
    run.version = IMUSCOPE_VERSION;
    run.progress = [&](const std::string& step, double share) { bar.show(step, share); };
    return run_studies(drives, run);
  }();
  if (!combined) return tl::unexpected<Error>(combined.error());
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const auto folder = drive_folder(options.out, i);
    if (auto written = write_report(folder); !written) return written;
    if (options.json) continue;
    say("\n--- drive {}\n", i + 1);
    if (auto printed = print_study(folder, false); !printed) return printed;
  }
  if (options.json) {
    say("{}\n", json_text(combination_json(*combined)));
  } else {
    say("\n--- all drives\n");
    print_combination(*combined);
  }
  return {};
}

Result<std::vector<Label>> read_labels(const std::string& file) {
  if (file.empty()) return std::vector<Label>{};
  const auto text = read_text_file(file, "file of labels", "give the path of a CSV file");
  if (!text) return tl::unexpected<Error>(text.error());
  return parse_labels(*text, file);
}

/// A report.html in a folder in which no run of ours ended is somebody else's.
Result<void> check_nothing_is_lost(const std::filesystem::path& out) {
  std::error_code error;
  // A link is replaced, and what it leads to stays as it is.
  if (!std::filesystem::is_regular_file(std::filesystem::symlink_status(out / "report.html", error)))
    return {};
  const auto run = tables::read_json_file(out / "run.json");
  if (run.is_object() && run.value("schema", "").starts_with("imuscope.run/")) return {};
  return usage_error(fmt::format("{} exists, and no run of imuscope made it", (out / "report.html").string()),
                     "give another --out, or --force to write over it");
}

Result<void> process(const ProcessCommand& options) {
  give_long_pieces_back();
  std::optional<tbb::global_control> limit;
  if (options.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(options.threads));
  if (!options.force) {
    if (auto checked = check_nothing_is_lost(options.out); !checked) return checked;
  }
  const auto drives = drives_of(options.inputs);
  if (drives.size() > 1 && !options.labels.empty())
    return usage_error("labels are of one drive", "process the drives one by one");
  if (drives.size() > 1 && !options.fix.empty())
    return usage_error("--fix is of one drive", "process the drives one by one");
  if (drives.size() > 1) return process_drives(options, drives);
  const auto labels = read_labels(options.labels);
  if (!labels) return tl::unexpected<Error>(labels.error());
  const auto opened = open_and_look(options.inputs, options.config, options.json);
  if (!opened) return tl::unexpected<Error>(opened.error());
  if (!options.fix.empty()) {
    if (auto written = write_fixed(opened->configuration, opened->findings, options.fix); !written)
      return written;
  }
  {
    ProgressBar bar;
    const StudyRunOptions run{
        options.out, IMUSCOPE_VERSION, [&](const std::string& step, double share) { bar.show(step, share); },
        {},          *labels,          opened->findings};
    if (auto done = run_study(opened->configuration, opened->recording, run); !done)
      return tl::unexpected<Error>(explained(done.error(), opened->findings));
  }
  if (auto written = write_report(options.out); !written) return written;
  if (auto printed = print_study(options.out, options.json); !printed) return printed;
  const std::string harm = harm_in_short(opened->findings);
  if (!options.json && !harm.empty()) say("\n{}\n", harm);
  return {};
}

}  // namespace

void add_process(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "process",
      "The study: calibration, error process, noise models, report; of several captures (or "
      "several files of every NAME), one mounting of all drives");
  auto options = std::make_shared<ProcessCommand>();
  add_inputs(*command, options->inputs, options->config);
  command->add_option("--out,-o", options->out, "folder for the results")->required()->type_name("DIR");
  command
      ->add_option("--labels", options->labels,
                   "regimes that a person named: CSV begin_s,end_s,regime or begin_utc,end_utc,regime")
      ->type_name("FILE");
  command
      ->add_option(
          "--fix", options->fix,
          "write a copy of the configuration with the lines corrected that the data show to be wrong")
      ->type_name("FILE");
  command->add_flag("--json", options->json, "print the summary as JSON");
  command
      ->add_option("--threads", options->threads,
                   "at most so many compute at once (default: as many as there are cores); from 2 on, "
                   "others read ahead and take what those leave idle")
      ->check(CLI::Range(1, kThreadsMax));
  command->add_flag("--force", options->force, "write over a report.html that no run of imuscope made");
  on_chosen(*command, chosen, [options] { return process(*options); });
}

}  // namespace imuscope::cli
