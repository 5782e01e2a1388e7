#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "base/json_text.h"
#include "base/text.h"
#include "commands.h"
#include "fleet/campaign.h"
#include "fleet/catalogue.h"
#include "fleet/content_hash.h"
#include "fleet/database.h"
#include "fleet/fleet_file.h"
#include "fleet/fleet_page.h"
#include "fleet/plan.h"
#include "fleet/study_task.h"
#include "fleet/unit_task.h"
#include "print.h"

namespace imuscope::cli {

namespace {

std::atomic<bool> fleet_stopped{false};  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)
extern "C" void stop_fleet(int) { fleet_stopped.store(true); }

/// This program, also where its file is replaced while a campaign runs.
constexpr const char* kThisProgram = "/proc/self/exe";
constexpr int kJobsMax = 1024;

void stop_on_signals() {
  std::signal(SIGINT, stop_fleet);
  std::signal(SIGTERM, stop_fleet);
}

struct FleetCommand {
  std::string file;
  int jobs = 0;
  bool retry = false;
  bool units = false;
  bool studies = false;
  std::string sql;
  std::string folder;
  bool where = false;
  bool json = false;
};

struct TaskCommand {
  fleet::StudyTask study;
  std::vector<std::string> files;
  std::string config;
  std::string unit;
  std::vector<std::string> drives;
};

struct Planned {
  fleet::FleetFile file;
  fleet::Plan plan;
};

Result<Planned> plan_of(const FleetCommand& options) {
  Planned out;
  auto file = fleet::read_fleet_file(options.file);
  if (!file) return tl::unexpected<Error>(file.error());
  out.file = std::move(*file);
  auto plan = fleet::plan_campaign(out.file, fleet::program_identity(IMUSCOPE_VERSION));
  if (!plan) return tl::unexpected<Error>(plan.error());
  out.plan = std::move(*plan);
  return out;
}

void say_end(const fleet::StudyTask& task, const fleet::TaskOutcome& outcome, std::size_t ended,
             std::size_t of) {
  if (outcome.was_there && outcome.state == fleet::TaskState::kStudied) return;
  std::string words =
      fmt::format("{} of {}: {}: {}", ended, of, one_line(task.name), fleet::key_of(outcome.state));
  if (outcome.was_there) words += " before";
  if (!outcome.reason.empty()) words += " (" + outcome.reason + ")";
  say("{}\n", words);
}

/// How many of how many, and what to do about the rest.
Result<void> say_count(const fleet::Plan& plan, const std::string& file) {
  const auto count = fleet::count_results(plan);
  for (const auto& capture : plan.captures) {
    if (!capture.not_studied.empty()) say("Not studied: {}: {}\n", capture.name, capture.not_studied);
  }
  say("{}\n", fleet::words_of(count));
  if (count.complete()) return {};
  if (count.gave_up > 0)
    return work_error("tasks were given up",
                      fmt::format("mend the cause, then imuscope fleet run {} --retry", file));
  return work_error("the campaign is not finished", fmt::format("go on with imuscope fleet run {}", file));
}

/// Catalogue and report of what there is.
Result<void> reduce_planned(const Planned& planned) {
  if (auto written = fleet::write_catalogue(planned.file, planned.plan); !written) return written;
  const auto page = fleet::write_fleet_page(planned.file.out, planned.file.name);
  if (!page) return tl::unexpected<Error>(page.error());
  say("Catalogue: {}\nReport:    {}\n", (planned.file.out / fleet::kCatalogue).string(), page->string());
  return {};
}

Result<void> run(const FleetCommand& options) {
  const auto planned = plan_of(options);
  if (!planned) return tl::unexpected<Error>(planned.error());
  stop_on_signals();
  fleet::RunOptions run;
  run.jobs = options.jobs > 0 ? static_cast<std::size_t>(options.jobs)
                              : std::max<std::size_t>(1, std::thread::hardware_concurrency());
  run.retry = options.retry;
  run.program_file = kThisProgram;
  run.on_end = say_end;
  if (auto done = fleet::run_campaign(planned->plan, run, fleet_stopped); !done) return done;
  if (!fleet_stopped.load()) {
    if (auto reduced = reduce_planned(*planned); !reduced) return reduced;
  }
  return say_count(planned->plan, options.file);
}

Result<void> tasks(const FleetCommand& options) {
  const auto planned = plan_of(options);
  if (!planned) return tl::unexpected<Error>(planned.error());
  const bool all = options.studies == options.units;
  if (all || options.studies) {
    for (const auto& task : planned->plan.studies) say("{}\n", fleet::shell_line(fleet::command_of(task)));
  }
  if (all || options.units) {
    for (const auto& task : planned->plan.units) say("{}\n", fleet::shell_line(fleet::command_of(task)));
  }
  return {};
}

Result<void> status(const FleetCommand& options) {
  if (options.where) {
    const auto file = fleet::read_fleet_file(options.file);
    if (!file) return tl::unexpected<Error>(file.error());
    say("{}\n", file->out.string());
    return {};
  }
  const auto planned = plan_of(options);
  if (!planned) return tl::unexpected<Error>(planned.error());
  return say_count(planned->plan, options.file);
}

Result<void> reduce(const FleetCommand& options) {
  const auto planned = plan_of(options);
  if (!planned) return tl::unexpected<Error>(planned.error());
  return fleet::write_catalogue(planned->file, planned->plan);
}

/// Of what the catalogue holds, without a look at the captures.
Result<void> report(const FleetCommand& options) {
  const auto file = fleet::read_fleet_file(options.file);
  if (!file) return tl::unexpected<Error>(file.error());
  const auto page = fleet::write_fleet_page(file->out, file->name);
  if (!page) return tl::unexpected<Error>(page.error());
  say("{}\n", page->string());
  return {};
}

/// The catalogue that is meant: a file of SQLite, or that of a fleet's file.
Result<std::filesystem::path> catalogue_of(const std::string& name) {
  if (std::filesystem::path(name).extension() != ".toml") return std::filesystem::path(name);
  const auto file = fleet::read_fleet_file(name);
  if (!file) return tl::unexpected<Error>(file.error());
  return file->out / fleet::kCatalogue;
}

std::string words_of_cell(const fleet::Cell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return fmt::format("{:.6g}", *number);
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return std::to_string(*whole);
  if (const auto* text = std::get_if<std::string>(&cell)) return one_line(*text);
  return "";
}

/// Columns under their names, as wide as what stands in them.
void say_table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths(rows.front().size(), 0);
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i)
      line += i + 1 == row.size() ? row[i] : fmt::format("{:<{}}  ", row[i], widths[i]);
    say("{}\n", line);
  }
}

Result<void> query(const FleetCommand& options) {
  const auto file = catalogue_of(options.file);
  if (!file) return tl::unexpected<Error>(file.error());
  const auto database = fleet::Database::open_to_read(*file);
  if (!database) return tl::unexpected<Error>(database.error());
  auto rows = database->prepare(options.sql);
  if (!rows) return tl::unexpected<Error>(rows.error());
  const auto names = rows->columns();
  if (names.empty())
    return usage_error("that returns nothing", "ask with SELECT; the catalogue can only be read");
  std::vector<std::vector<std::string>> table{names};
  auto list = nlohmann::json::array();
  for (;;) {
    const auto more = rows->next();
    if (!more) return tl::unexpected<Error>(more.error());
    if (!*more) break;
    auto object = nlohmann::json::object();
    std::vector<std::string> words;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto cell = rows->cell(static_cast<int>(i));
      if (options.json) {
        std::visit(
            [&](const auto& value) {
              if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::monostate>) {
                object[names[i]] = nullptr;
              } else {
                object[names[i]] = value;
              }
            },
            cell);
      } else {
        words.push_back(words_of_cell(cell));
      }
    }
    if (options.json)
      list.push_back(std::move(object));
    else
      table.push_back(std::move(words));
  }
  if (options.json)
    say("{}\n", json_text(list));
  else
    say_table(table);
  return {};
}

Result<void> export_tables(const FleetCommand& options) {
  const auto file = catalogue_of(options.file);
  if (!file) return tl::unexpected<Error>(file.error());
  return fleet::export_csv(*file, options.folder);
}

Result<void> study(const TaskCommand& options) {
  stop_on_signals();
  fleet::StudyTask task = options.study;
  for (const auto& file : options.files) task.files.emplace_back(file);
  if (!options.config.empty()) task.config = options.config;
  const auto outcome =
      fleet::do_study(task, fleet::program_identity(IMUSCOPE_VERSION), kThisProgram, fleet_stopped);
  if (!outcome) return tl::unexpected<Error>(outcome.error());
  say_end(task, *outcome, 1, 1);
  // A refusal is a result. What was given up is one, too, and told by its row.
  if (outcome->state == fleet::TaskState::kInterrupted)
    return work_error(task.name + ": interrupted", "call it again");
  return {};
}

Result<void> unit(const TaskCommand& options) {
  fleet::UnitTask task;
  task.out = options.study.out;
  task.key = options.study.key;
  task.unit = options.unit;
  for (const auto& words : options.drives) {
    const auto first = words.find('=');
    const auto second = words.find('=', first + 1);
    if (first == std::string::npos || second == std::string::npos)
      return usage_error(fmt::format("'{}' is no drive of a unit", words),
                         "write STUDY=DEVICE=VEHICLE/MOUNTING, as imuscope fleet tasks does");
    task.drives.push_back(
        {words.substr(0, first), words.substr(first + 1, second - first - 1), words.substr(second + 1)});
  }
  return fleet::do_unit(task, fleet::program_identity(IMUSCOPE_VERSION));
}

/// A command of `imuscope fleet` that takes the fleet's file.
CLI::App* add_of_file(CLI::App& fleet, Work& chosen, const char* name, const char* what,
                      const std::shared_ptr<FleetCommand>& options,
                      Result<void> (*work)(const FleetCommand&)) {
  auto* command = fleet.add_subcommand(name, what);
  command->add_option("FLEET.toml", options->file, "the description of the fleet (docs/fleet.md)")
      ->required();
  on_chosen(*command, chosen, [options, work] { return work(*options); });
  return command;
}

CLI::App* add_task(CLI::App& fleet, Work& chosen, const char* name, const char* what,
                   const std::shared_ptr<TaskCommand>& options, Result<void> (*work)(const TaskCommand&)) {
  auto* command = fleet.add_subcommand(name, what);
  command->add_option("--out", options->study.out, "folder of the campaign")->required()->type_name("DIR");
  command->add_option("--key", options->study.key, "of the task")->required();
  on_chosen(*command, chosen, [options, work] { return work(*options); });
  return command;
}

void add_tasks(CLI::App& fleet, Work& chosen) {
  auto options = std::make_shared<TaskCommand>();
  auto* one = add_task(fleet, chosen, "study", "A task: the study of one capture", options, study);
  one->add_option("--name", options->study.name, "of the capture");
  one->add_option("--config", options->config, "configuration in the place of the capture's own")
      ->type_name("FILE");
  one->add_flag("--keep-all", options->study.keep_all_files, "keep the rows of the run folder, too");
  one->add_option("--attempts", options->study.limits.attempts, "that may die before the task is given up")
      ->check(CLI::Range(1, kJobsMax));
  one->add_option("--memory-mb", options->study.limits.memory_mb, "most memory of the study");
  one->add_option("--timeout-s", options->study.limits.timeout_s, "longest time of an attempt");
  one->add_option("FILE.lcm", options->files, "the capture's files, in order")->required();
  one = add_task(fleet, chosen, "unit", "A task: one unit over its drives", options, unit);
  one->add_option("--unit", options->unit, "serial number")->required();
  one->add_option("DRIVE", options->drives, "STUDY=DEVICE=VEHICLE/MOUNTING")->required();
}

}  // namespace

void add_fleet(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("fleet", "Studies of many captures, and what all units and drives tell together");
  command->require_subcommand(1);
  auto options = std::make_shared<FleetCommand>();
  auto* one = add_of_file(*command, chosen, "run",
                          "All tasks on the cores of this machine, then catalogue and report", options, run);
  one->add_option("--jobs,-j", options->jobs, "studies at once (default: as many as there are cores)")
      ->check(CLI::Range(1, kJobsMax));
  one->add_flag("--retry", options->retry, "try again what was given up");
  one = add_of_file(*command, chosen, "tasks", "Prints the tasks as command lines, for workflow managers",
                    options, tasks);
  one->add_flag("--studies", options->studies, "those of captures alone, which need nothing before them");
  one->add_flag("--units", options->units, "those of units alone, which come after all studies");
  one = add_of_file(*command, chosen, "status", "How many of how many", options, status);
  one->add_flag("--folder", options->where, "prints the campaign's folder alone");
  add_of_file(*command, chosen, "reduce", "The catalogue from all results that there are", options, reduce);
  add_of_file(*command, chosen, "report", "The page of the fleet from its catalogue", options, report);
  constexpr const char* kWhich = "the fleet's file, or its catalogue";
  one = command->add_subcommand("query", "Asks the catalogue, which it cannot change");
  one->add_option("FLEET.toml", options->file, kWhich)->required();
  one->add_option("SQL", options->sql, "one statement; docs/fleet.md has tables and views")->required();
  one->add_flag("--json", options->json, "as JSON");
  on_chosen(*one, chosen, [options] { return query(*options); });
  one = command->add_subcommand("export", "The catalogue's tables as CSV files");
  one->add_option("FLEET.toml", options->file, kWhich)->required();
  one->add_option("--csv", options->folder, "folder for them")->required()->type_name("DIR");
  on_chosen(*one, chosen, [options] { return export_tables(*options); });
  add_tasks(*command, chosen);
}

}  // namespace imuscope::cli
