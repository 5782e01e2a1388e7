#pragma once

/// A process beside the test's own, for what cannot be taken back: other rights, other mounts, another
/// network.

#include <linux/capability.h>
#include <sys/mount.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <sched.h>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <string>

namespace imuscope::test {

/// What a child returns where it may not do what the test needs.
inline constexpr int kNotPermitted = 77;

/// Runs `body` in a child process.
/// @return what it returned; -1 where it died
template <typename Body>
int in_child(const Body& body) {
  const pid_t child = fork();
  if (child == 0) {
    try {
      _exit(body());
    } catch (...) {
      std::abort();  // or the child would go on with the tests that follow
    }
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// Runs `body` in a child with a network of its own: a loopback interface that is down, no routes.
/// @return what it returned; kNotPermitted without root
template <typename Body>
int in_private_network(const Body& body) {
  return in_child([&] { return unshare(CLONE_NEWNET) == 0 ? body() : kNotPermitted; });
}

/// In a child: from here on permissions hold it back, root or not. It stays who it is, so that its own
/// folders, which may lie in root's home, stay within reach.
inline bool become_ordinary() {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  const std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> none{};
  return syscall(SYS_capset, &header, none.data()) == 0;
}

/// In a child: `folder` is a disk of its own, in memory and of this size.
/// @param size  such as "1m"
inline bool mount_disk(const std::filesystem::path& folder, const char* size) {
  const std::string options = std::string("size=") + size;
  return unshare(CLONE_NEWNS) == 0 && mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
         mount("tmpfs", folder.c_str(), "tmpfs", 0, options.c_str()) == 0;
}

}  // namespace imuscope::test
