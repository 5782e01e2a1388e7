#pragma once

/// The subcommands of `imuscope`. Each registers its options with CLI11 and hands its work to `Commands`; the
/// work runs after parsing, so that every wrong option is told before anything starts.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope::cli {

/// The work of the chosen subcommand: nothing on success, else an Error that main() prints and turns into the
/// exit code (2 usage or configuration, 1 failed work).
using Work = std::function<Result<void>()>;

/// Called by a subcommand's registration: sets the work that runs when that subcommand was chosen.
inline void on_chosen(CLI::App& subcommand, Work& chosen, Work work) {
  subcommand.callback([&chosen, work = std::move(work)] { chosen = work; });
}

/// All subcommands of the program: all_commands.cpp or live_commands.cpp, whichever it is built with.
void add_commands(CLI::App& app, Work& chosen);
/// Of those, what looks after recordings, devices and a running service; both packages have it.
void add_care_commands(CLI::App& app, Work& chosen);

/// Those that the other package has beyond these.
[[nodiscard]] std::vector<std::string> commands_of_another_package();

/// Makes a report of a run folder.
using ReportWriter = std::function<Result<void>(const std::filesystem::path& run_dir)>;

// One function a subcommand, one file a function (command_NAME.cpp).

/// `imuscope wv FILE --rate HZ`
void add_wv(CLI::App& app, Work& chosen);

/// `imuscope fit FILE --rate HZ --model 'WN+2*GM'`
void add_fit(CLI::App& app, Work& chosen);

/// `imuscope fleet run FLEET.toml`
void add_fleet(CLI::App& app, Work& chosen);

/// `imuscope characterize FILE...`
void add_characterize(CLI::App& app, Work& chosen);

/// `imuscope correlate RUN` or `LOG`
void add_correlate(CLI::App& app, Work& chosen);

/// `imuscope compare A.json B.json`
void add_compare(CLI::App& app, Work& chosen);

/// `imuscope export MODEL.json --to kalibr|ros|px4|kf-gins|state-space`
void add_export(CLI::App& app, Work& chosen);

/// `imuscope run CONFIG`
/// @param write_report  called at the end; empty where the program makes no reports
void add_run(CLI::App& app, Work& chosen, const ReportWriter& write_report);

/// `imuscope replay INPUT...`
void add_replay(CLI::App& app, Work& chosen);

/// `imuscope process INPUT...`
void add_process(CLI::App& app, Work& chosen);

/// `imuscope combine RUN_DIR...`
void add_combine(CLI::App& app, Work& chosen);

/// `imuscope evaluate RUN_DIR`
void add_evaluate(CLI::App& app, Work& chosen);

/// `imuscope report RUN_DIR`
void add_report(CLI::App& app, Work& chosen);

/// `imuscope tables RUN_DIR`
void add_tables(CLI::App& app, Work& chosen);

/// `imuscope import --out CAPTURE NAME=FILE...`
void add_import(CLI::App& app, Work& chosen);

/// `imuscope capture check|repair FILE`
void add_capture(CLI::App& app, Work& chosen);

/// `imuscope probe`
void add_probe(CLI::App& app, Work& chosen);

/// `imuscope decode FILE`
void add_decode(CLI::App& app, Work& chosen);

/// `imuscope doctor [CONFIG]`
void add_doctor(CLI::App& app, Work& chosen);

/// `imuscope config [CONFIG]`
void add_config(CLI::App& app, Work& chosen);

/// `imuscope top`
void add_top(CLI::App& app, Work& chosen);

/// `imuscope view [RECORDING]`
void add_view(CLI::App& app, Work& chosen);

/// `imuscope status`
void add_status(CLI::App& app, Work& chosen);

/// `imuscope keep RUN_DIR`
void add_keep(CLI::App& app, Work& chosen);

/// `imuscope completion bash|zsh|fish`
void add_completion(CLI::App& app, Work& chosen);

/// `imuscope help [COMMAND]`
void add_help(CLI::App& app, Work& chosen);

/// What is said of a word that is no command, with the nearest one that is.
[[nodiscard]] std::string no_such_command(const CLI::App& app, const std::string& word);

}  // namespace imuscope::cli
