#pragma once

/// Commands of imuscope in this process, as main() runs them.

#include <spdlog/sinks/null_sink.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "commands.h"
#include "tests/fuzz/fuzz.h"

namespace imuscope::fuzz {

/// Runs one command. Whatever it was given, it ends with a result or with an error that says what is wrong,
/// and throws nothing.
inline bool run_command(std::vector<std::string> arguments) {
  static const bool quiet = [] {
    spdlog::set_default_logger(spdlog::null_logger_mt("fuzz"));
    return std::freopen("/dev/null", "w", stdout) != nullptr;
  }();
  require(quiet, "what a command prints goes nowhere");
  CLI::App app;
  cli::Work work;
  cli::add_replay(app, work);
  cli::add_process(app, work);
  cli::add_report(app, work);
  cli::add_tables(app, work);
  cli::add_evaluate(app, work);
  cli::add_combine(app, work);
  std::reverse(arguments.begin(), arguments.end());
  app.parse(arguments);
  const auto done = work();
  require(done.has_value() || !done.error().what.empty(), "an error says what is wrong");
  return done.has_value();
}

}  // namespace imuscope::fuzz
