#include "programs.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>
#include <fstream>

#include "tests/support/shared_data.h"

namespace imuscope::test {

namespace {

pid_t start(const std::string& program, const std::vector<std::string>& arguments,
            const std::filesystem::path& log) {
  std::vector<std::string> words{program_path(program).string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child != 0) return child;
  const int file = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  dup2(file, STDOUT_FILENO);
  dup2(file, STDERR_FILENO);
  execv(argv.front(), argv.data());
  _exit(127);
}

int wait_for(pid_t process) {
  int status = 0;
  if (waitpid(process, &status, 0) != process) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

int run_program(const std::string& program, const std::vector<std::string>& arguments,
                const std::filesystem::path& log) {
  return wait_for(start(program, arguments, log));
}

BackgroundProgram::BackgroundProgram(const std::string& program, const std::vector<std::string>& arguments,
                                     const std::filesystem::path& log)
    : process_(start(program, arguments, log)) {}

BackgroundProgram::~BackgroundProgram() {
  if (process_ <= 0) return;
  kill(process_, SIGKILL);
  wait_for(process_);
}

void BackgroundProgram::send(int signal) const { kill(process_, signal); }

void BackgroundProgram::interrupt() const { send(SIGINT); }

int BackgroundProgram::wait() {
  const int code = wait_for(process_);
  process_ = 0;
  return code;
}

std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

nlohmann::json read_json(const std::filesystem::path& file) { return nlohmann::json::parse(read_text(file)); }

}  // namespace imuscope::test
