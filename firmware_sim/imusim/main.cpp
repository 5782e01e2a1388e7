#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>
#include <map>

#include "firmware_sim/imusim/fault_script.h"
#include "firmware_sim/imusim/live.h"
#include "firmware_sim/imusim/record.h"

namespace {

using namespace imusim;

constexpr double kSecondsPerMinute = 60.0;
/// A day, the longest scenario.
constexpr double kLongest_s = 86400.0;

std::atomic<bool> g_stop = false;

void stop_on_signal(int /*signal*/) { g_stop.store(true); }

void show_progress(double share) {
  constexpr int kWidth = 40;
  const int filled = static_cast<int>(share * kWidth);
  fmt::print(stderr, "\rrecording [{:#<{}}{:.<{}}] {:3.0f} %{}", "", filled, "", kWidth - filled,
             100.0 * share, share >= 1.0 ? "\n" : "");
  std::fflush(stderr);
}

/// What both commands take.
struct Common {
  std::string config;
  std::optional<double> minutes;
  std::optional<std::uint64_t> seed;
  std::optional<std::string> faults;
  std::optional<WorldKind> world;
  std::optional<int> reference;
  std::optional<double> pc_ppm;

  void add_to(CLI::App& command) {
    command.add_option("CONFIG", config, "configuration with a [simulation] table, such as config/demo.toml")
        ->required();
    command.add_option("--minutes", minutes, "length of the scenario, instead of the configuration's")
        ->check(CLI::Range(0.05, 1440.0));
    command.add_option("--seed", seed, "seed of all randomness, instead of the configuration's");
    command
        .add_option("--world", world,
                    "ideal, or harsh: all that data sheets allow of a sensor; instead of the configuration's")
        ->transform(CLI::CheckedTransformer(
            std::map<std::string, WorldKind>{{"ideal", WorldKind::kIdeal}, {"harsh", WorldKind::kHarsh}}));
    command
        .add_option("--reference-class", reference,
                    "noise of the reference, from 1 (0.0015 deg/sqrt(h)) to 5 (4.8), "
                    "instead of the configuration's")
        ->check(CLI::Range(1, kReferenceClasses));
    command.add_option("--pc-ppm", pc_ppm, "rate of the PC's clock, instead of the configuration's or drawn")
        ->check(CLI::Range(-1000.0, 1000.0));
    command.add_option("--faults", faults,
                       "fault script: what goes wrong, and when; config/faults.toml explains it");
  }
  [[nodiscard]] Outcome<Configuration> load() const {
    Outcome<Configuration> configuration = load_configuration(config);
    if (configuration && minutes) configuration->scenario.duration_s = *minutes * kSecondsPerMinute;
    if (configuration && seed) configuration->scenario.seed = *seed;
    if (configuration && world) configuration->world = *world;
    if (configuration && reference) configuration->reference.noise = reference_class(*reference);
    if (configuration && pc_ppm) {
      configuration->line.clock.rate_ppm = *pc_ppm;
      configuration->has_pc_rate = true;
    }
    if (configuration && faults) {
      if (auto loaded = load_faults(*faults, *configuration); !loaded) return tl::unexpected(loaded.error());
    }
    return configuration;
  }
};

struct RecordCommand {
  Common common;
  RecordOptions options;
  std::string folder;

  Outcome<void> run() {
    const auto configuration = common.load();
    if (!configuration) return tl::unexpected(configuration.error());
    options.folder = folder;
    if (::isatty(STDERR_FILENO) != 0) options.on_progress = show_progress;
    const auto recorded = record(*configuration, options);
    if (!recorded) return tl::unexpected(recorded.error());
    for (const Recorded& device : *recorded)
      fmt::print("{:<10} {:>10} bytes in {} reads\n", device.name, device.bytes, device.reads);
    fmt::print("{:.1f} s of driving, seed {}, in {}\n", configuration->scenario.duration_s,
               configuration->scenario.seed, folder);
    return {};
  }
};

struct LiveCommand {
  Common common;
  LiveOptions options;
  bool skip_static = false;
  std::optional<std::string> folder;

  Outcome<void> run() {
    const auto configuration = common.load();
    if (!configuration) return tl::unexpected(configuration.error());
    if (skip_static) options.start_s = initial_standstill_s(configuration->scenario);
    if (folder) options.folder = *folder;
    options.on_line = [](const std::string& line) {
      fmt::print("{}\n", line);
      std::fflush(stdout);
    };
    struct sigaction action {};
    action.sa_handler = stop_on_signal;
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    const auto counts = play(*configuration, options, g_stop);
    if (!counts) return tl::unexpected(counts.error());
    for (const LiveCounts& device : *counts)
      fmt::print("{:<10} {} bytes sent, {} dropped, {} received\n", device.name, device.sent_bytes,
                 device.dropped_bytes, device.received_bytes);
    return {};
  }
};

/// What CLI11 found wrong with the arguments, as one sentence.
std::string usage_sentence(const CLI::App* app, const CLI::Error& error) {
  std::string command = "imusim";
  std::string what = error.what();
  const auto chosen = app->get_subcommands();
  if (!chosen.empty()) {
    command += " " + chosen.front()->get_name();
  } else if (!app->remaining().empty()) {
    what = "there is no command '" + app->remaining().front() + "'";
  }
  return fmt::format("imusim: {}; see {} --help\n", what, command);
}

int run(int argc, char** argv) {
  CLI::App app{"imusim: simulated IMUs and a GNSS receiver on a vehicle, as bytes"};
  app.require_subcommand(1);
  app.failure_message(usage_sentence);
  app.set_version_flag("--version", IMUSIM_VERSION);
  std::function<Outcome<void>()> work;

  RecordCommand record_command;
  CLI::App* record = app.add_subcommand(
      "record", "writes what the devices send, when it arrives (also as one capture), and the truth");
  record_command.common.add_to(*record);
  record->add_option("--out", record_command.folder, "folder to write to")->required();
  record->add_flag("--errors", record_command.options.true_errors,
                   "also write every S-IMU's true errors: errors_truth_NAME.csv");
  record->add_option("--truth-hz", record_command.options.truth_rows_hz, "rows of truth.csv a second")
      ->check(CLI::Range(1.0, 1000.0));
  record->callback([&] { work = [&] { return record_command.run(); }; });

  LiveCommand live_command;
  CLI::App* live = app.add_subcommand("live", "plays the devices in real time on pseudo-terminals");
  live_command.common.add_to(*live);
  live->add_option("--seconds", live_command.options.seconds, "how long; to the scenario's end by default")
      ->check(CLI::Range(0.01, kLongest_s));
  CLI::Option* start =
      live->add_option("--start-s", live_command.options.start_s, "begin this far into the scenario")
          ->check(CLI::Range(0.0, kLongest_s));
  live->add_flag("--skip-static", live_command.skip_static, "begin where the vehicle starts to move")
      ->excludes(start);
  live->add_option("--out", live_command.folder, "folder for truth.json and truth.csv");
  live->callback([&] { work = [&] { return live_command.run(); }; });

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    constexpr int kExitUsage = 2;
    return app.exit(error) == 0 ? 0 : kExitUsage;
  }
  const Outcome<void> outcome = work();
  if (outcome) return 0;
  fmt::print(stderr, "imusim: {}\n", outcome.error().text);
  return outcome.error().exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "imusim: unexpected failure: {}\n", error.what());
    return 1;
  }
}
