#include <fmt/format.h>
#include <sys/stat.h>
#include <cstdio>
#include <exception>
#include <string>

#include "base/text.h"
#include "commands.h"
#include "log_format.h"

namespace {

/// What CLI11 found wrong with the arguments, as one sentence.
std::string usage_sentence(const CLI::App* app, const CLI::Error& error) {
  std::string command = "imuscope";
  std::string what = error.what();
  const auto chosen = app->get_subcommands();
  if (!chosen.empty()) {
    command += " " + chosen.front()->get_name();
  } else if (!app->remaining().empty()) {
    what = imuscope::cli::no_such_command(*app, app->remaining().front());
  }
  return fmt::format("imuscope: {}; see {} --help\n", what, command);
}

/// To the person who started the program, if still there: a closed terminal is no failure of its own.
void say(const std::string& sentence) { (void)std::fputs(sentence.c_str(), stderr); }

int run(int argc, char** argv) {
  CLI::App app{"imuscope: shows, live on a moving vehicle, how wrong a low-cost IMU is, and why", "imuscope"};
  app.require_subcommand(1);
  app.failure_message(usage_sentence);
  app.set_version_flag("--version", IMUSCOPE_VERSION);
  imuscope::cli::Work work;
  imuscope::cli::add_commands(app, work);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    constexpr int kExitUsage = 2;
    return app.exit(error) == 0 ? 0 : kExitUsage;
  }
  // Whatever the umask: nobody else writes to what a run leaves.
  ::umask(::umask(S_IWOTH) | S_IWOTH);
  // Results go to stdout, the log to stderr.
  imuscope::cli::set_up_log();
  const auto result = work();
  if (result) return 0;
  say(fmt::format("{}imuscope: {}\n", imuscope::cli::error_prefix(),
                  imuscope::one_line(result.error().text())));
  return result.error().kind == imuscope::ErrorKind::kUsage ? 2 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    say(fmt::format("imuscope: unexpected failure: {}\n", error.what()));
    return 1;
  }
}
