#include <atomic>
#include <csignal>
#include <memory>

#include "commands.h"
#include "findings.h"
#include "print.h"
#include "service/live/live.h"

namespace imuscope::cli {

namespace {

// A signal handler may only set lock-free flags.
LiveSignals signals;  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

extern "C" void request_stop(int) { signals.stop.store(true); }
extern "C" void hang_up(int) { signals.hang_up.store(true); }

/// What --seconds accepts: something worth recording, to a year.
constexpr double kShortestRun_s = 0.1;
constexpr double kLongestRun_s = 365.0 * 86400.0;

struct RunCommand {
  std::string config;
  std::string out;
  double seconds = 0.0;
  bool no_report = false;
};

Result<void> run(const RunCommand& options, const ReportWriter& write_report) {
  const auto configuration = load_configuration(options.config);
  if (!configuration) return tl::unexpected<Error>(configuration.error());
  LiveOptions live;
  live.out = options.out;
  live.parent = configuration->record.folder.empty() ? "runs" : configuration->record.folder;
  live.version = IMUSCOPE_VERSION;
  if (options.seconds > 0.0) live.duration_s = options.seconds;
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  // Under nohup it stays ignored.
  if (std::signal(SIGHUP, hang_up) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
  // Ctrl-C ends `tee` behind a pipe, too: what is lost then is the log's end and not the run's.
  std::signal(SIGPIPE, SIG_IGN);
  const bool has_report = write_report && !options.no_report;
  live.add_documents = [&](const std::filesystem::path& folder) -> Result<void> {
    if (options.no_report) return {};
    if (auto looked = look_at_live_run(folder); !looked) return looked;
    return has_report ? write_report(folder) : Result<void>{};
  };
  const auto folder = run_live(*configuration, live, signals);
  if (!folder) return tl::unexpected<Error>(folder.error());
  say("Results: {}\nReport:  {}\n", folder->string(),
      has_report ? (*folder / "report.html").string() : "imuscope report " + folder->string());
  return {};
}

}  // namespace

void add_run(CLI::App& app, Work& chosen, const ReportWriter& write_report) {
  auto* command = app.add_subcommand("run", "The live service: devices, estimator, recording, LCM");
  auto options = std::make_shared<RunCommand>();
  command->add_option("config", options->config, "configuration (TOML)")->required()->type_name("CONFIG");
  command
      ->add_option(
          "--out,-o", options->out,
          "folder for capture and results (default: NAME-TIME in the folder of [record], or in runs)")
      ->type_name("DIR");
  command->add_option("--seconds", options->seconds, "end by itself after this time")
      ->check(CLI::Range(kShortestRun_s, kLongestRun_s));
  command->add_flag(
      "--no-report", options->no_report,
      "end without report.html, which takes a while after a long run; `imuscope report` makes it later");
  on_chosen(*command, chosen, [options, write_report] { return run(*options, write_report); });
}

}  // namespace imuscope::cli
