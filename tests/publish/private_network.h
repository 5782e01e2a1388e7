#pragma once

/// A network namespace of a test's own.

#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>

namespace imuscope::test {

inline constexpr int kNotPermitted = 77;

/// Runs `body` in a child process with a network of its own: a loopback interface that is down, no routes.
/// @return what it returned; kNotPermitted without root
inline int in_private_network(const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    if (unshare(CLONE_NEWNET) != 0) _exit(kNotPermitted);
    _exit(body());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace imuscope::test
