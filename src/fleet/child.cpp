#include "fleet/child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>

namespace imuscope::fleet {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kBytesPerMb = 1e6;
/// ru_maxrss is in units of 1024 bytes.
constexpr double kMbPerKilobyte = 1024.0 / 1e6;
constexpr double kSecondsPerMicrosecond = 1e-6;
/// How often a running program is looked at for a stop or the end of its time.
constexpr int kLook_ms = 100;
/// What the shell says where a program cannot be started.
constexpr int kCannotStart = 127;

double seconds_of(const timeval& time) {
  return static_cast<double>(time.tv_sec) + kSecondsPerMicrosecond * static_cast<double>(time.tv_usec);
}

/// In the child, between fork and exec: calls that are safe there alone.
[[noreturn]] void become(char* const* words, int log, const ChildLimits& limits, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(kCannotStart);
  if (limits.memory_mb > 0.0) {
    const auto bytes = static_cast<rlim_t>(limits.memory_mb * kBytesPerMb);
    const rlimit limit{bytes, bytes};
    ::setrlimit(RLIMIT_DATA, &limit);
  }
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  // A campaign that is stopped ends its programs itself.
  ::signal(SIGINT, SIG_IGN);
  const int nothing = ::open("/dev/null", O_RDONLY);
  ::dup2(nothing, STDIN_FILENO);
  ::dup2(log, STDOUT_FILENO);
  ::dup2(log, STDERR_FILENO);
  ::execv(words[0], words);
  ::_exit(kCannotStart);
}

/// Waits for the end; ends the program where it is told to, or its time is over.
void wait_for(const Descriptor& process, pid_t child, const ChildLimits& limits, Clock::time_point began,
              const std::atomic<bool>& stop, ChildEnd& end) {
  for (;;) {
    pollfd look{process.get(), POLLIN, 0};
    if (::poll(&look, 1, kLook_ms) > 0) return;
    const double passed_s = std::chrono::duration<double>(Clock::now() - began).count();
    end.stopped = stop.load();
    end.timed_out = !end.stopped && limits.timeout_s > 0.0 && passed_s > limits.timeout_s;
    if (!end.stopped && !end.timed_out) continue;
    ::kill(child, SIGKILL);
    return;
  }
}

}  // namespace

Result<ChildEnd> run_child(const std::vector<std::string>& words, const OutputFolder& folder,
                           const std::string& log, const ChildLimits& limits, const std::atomic<bool>& stop) {
  const Descriptor output = folder.create_new(log);
  if (!output.is_open())
    return work_error(
        fmt::format("{} cannot be written: {}", (folder.path() / log).string(), std::strerror(errno)));
  std::vector<char*> pointers;
  for (const auto& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
  pointers.push_back(nullptr);
  const auto began = Clock::now();
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) return work_error(fmt::format("{} cannot be started: {}", words[0], std::strerror(errno)));
  if (child == 0) become(pointers.data(), output.get(), limits, parent);
  // Not by the name of the C library, which glibc 2.36 declares for C alone.
  const Descriptor process(static_cast<int>(::syscall(SYS_pidfd_open, child, 0)));
  ChildEnd end;
  if (process.is_open()) wait_for(process, child, limits, began, stop, end);
  int status = 0;
  rusage used{};
  while (::wait4(child, &status, 0, &used) < 0 && errno == EINTR) {
  }
  end.wall_s = std::chrono::duration<double>(Clock::now() - began).count();
  end.cpu_s = seconds_of(used.ru_utime) + seconds_of(used.ru_stime);
  end.peak_mb = kMbPerKilobyte * static_cast<double>(used.ru_maxrss);
  if (WIFEXITED(status)) end.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  if (end.exit_code == kCannotStart) return work_error(fmt::format("{} cannot be started", words[0]));
  return end;
}

}  // namespace imuscope::fleet
