#pragma once

/// The core guard (tests/core_guard) around a program, and what it reported.

#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {

/// Programs started while this exists have the guard preloaded.
class ScopedGuard {
 public:
  explicit ScopedGuard(const std::filesystem::path& report) {
    setenv("LD_PRELOAD", program_path("libcore_guard.so").c_str(), 1);
    setenv("CORE_GUARD_REPORT", report.c_str(), 1);
  }
  ~ScopedGuard() {
    unsetenv("LD_PRELOAD");
    unsetenv("CORE_GUARD_REPORT");
  }
  ScopedGuard(const ScopedGuard&) = delete;
  ScopedGuard& operator=(const ScopedGuard&) = delete;
};

/// Counts by what was counted, by thread.
using GuardReport = std::map<std::string, std::map<std::string, long>>;

inline GuardReport read_guard_report(const std::filesystem::path& file) {
  GuardReport report;
  std::istringstream lines(read_text(file));
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("imuscope-")) continue;  // a line of a trace
    std::istringstream words(line);
    std::string thread;
    words >> thread;
    std::string what;
    for (long count = 0; words >> what >> count;) report[thread][what] = count;
  }
  return report;
}

/// What must not happen in a thread of the core.
inline std::map<std::string, long> offences_of(const std::map<std::string, long>& thread) {
  std::map<std::string, long> offences = thread;
  for (const char* fact : {"waits", "last_forbidden", "page_faults"}) offences.erase(fact);
  return offences;
}

}  // namespace imuscope::test
