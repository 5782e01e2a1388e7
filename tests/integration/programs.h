#pragma once

/// Starts the built programs as a user would.

#include <sys/types.h>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace imuscope::test {

/// Runs a program to its end, its output into `log`. Returns its exit code, or -1.
int run_program(const std::string& program, const std::vector<std::string>& arguments,
                const std::filesystem::path& log);

/// A program that runs beside the test. Killed at the end of its life if it still runs.
class BackgroundProgram {
 public:
  BackgroundProgram(const std::string& program, const std::vector<std::string>& arguments,
                    const std::filesystem::path& log);
  ~BackgroundProgram();
  BackgroundProgram(const BackgroundProgram&) = delete;
  BackgroundProgram& operator=(const BackgroundProgram&) = delete;
  void send(int signal) const;
  void interrupt() const;  ///< as Ctrl-C does
  int wait();              ///< its exit code, or -1
  [[nodiscard]] pid_t id() const { return process_; }

 private:
  pid_t process_;
};

std::string read_text(const std::filesystem::path& file);
nlohmann::json read_json(const std::filesystem::path& file);

}  // namespace imuscope::test
