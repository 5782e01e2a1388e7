#include "results/page/printed_page.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>
#include <vector>

extern char** environ;

namespace imuscope::page {
namespace {

namespace fs = std::filesystem;

/// The one without windows starts in a third of the time.
constexpr std::array kBrowsers{"chromium-headless-shell", "chromium"};
constexpr std::chrono::seconds kPatience{120};
constexpr std::chrono::milliseconds kLook{50};

/// A folder of the browser's own, gone at the end of this object's life.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "imuscope-page-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// Waits for the browser; false where it did not end in time or not well.
bool ended_well(pid_t browser) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  int status = 0;
  while (waitpid(browser, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > until) {
      kill(browser, SIGKILL);
      waitpid(browser, &status, 0);
      return false;
    }
    std::this_thread::sleep_for(kLook);
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// Starts the first browser that is there, silently. False where none could be started.
bool start(std::vector<std::string> arguments, pid_t& child) {
  arguments.insert(arguments.begin(), "");  // the place of the program's name
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
    posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_RDWR, 0);
  const bool started = std::ranges::any_of(kBrowsers, [&](std::string browser) {
    pointers.front() = browser.data();
    return posix_spawnp(&child, browser.c_str(), &actions, nullptr, pointers.data(), environ) == 0;
  });
  posix_spawn_file_actions_destroy(&actions);
  return started;
}

}  // namespace

Result<fs::path> print_page(const OutputFolder& folder, const std::string& html_name) {
  const ScratchFolder scratch;
  if (scratch.path().empty())
    return work_error("no folder for the browser could be made", "check the space in the folder of TMPDIR");
  const fs::path page = fs::absolute(folder.path() / html_name);
  const fs::path printed = scratch.path() / "page.pdf";
  std::vector<std::string> arguments{"--headless",
                                     "--disable-gpu",
                                     "--no-first-run",
                                     "--disable-background-networking",
                                     "--disable-component-update",
                                     "--disable-sync",
                                     "--no-pdf-header-footer",
                                     "--virtual-time-budget=20000",
                                     "--user-data-dir=" + (scratch.path() / "profile").string(),
                                     "--print-to-pdf=" + printed.string()};
  // Its sandbox wants a user who is not root; the page is our own and loads nothing.
  if (geteuid() == 0) arguments.emplace_back("--no-sandbox");
  arguments.push_back("file://" + page.string());
  pid_t browser = 0;
  if (!start(std::move(arguments), browser)) {
    return work_error(
        "chromium could not be started",
        fmt::format("install it (apt-get install chromium-headless-shell), or print {} elsewhere",
                    page.string()));
  }
  const bool well = ended_well(browser);
  std::ifstream in(printed, std::ios::binary);
  std::ostringstream content;
  content << in.rdbuf();
  if (!well || content.str().rfind("%PDF", 0) != 0)
    return work_error(fmt::format("chromium did not print {}", page.string()),
                      "open it and print it by hand");
  const std::string name = fs::path(html_name).stem().string() + ".pdf";
  if (auto written = folder.write_whole(name, content.str()); !written)
    return tl::unexpected<Error>(written.error());
  return folder.path() / name;
}

}  // namespace imuscope::page
