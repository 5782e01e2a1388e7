#include "service/live/retention.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/digits.h"
#include "base/text.h"
#include "capture/capture_files.h"
#include "rt/host_clock.h"
#include "rt/thread_setup.h"
#include "service/live/live_bag.h"

namespace imuscope {

namespace {

constexpr auto kPeriod = std::chrono::minutes(1);
constexpr double kBytesPerGb = 1e9;
constexpr double kSPerDay = 86400.0;
constexpr const char* kCaptureName = "capture.lcm";

/// Name of a file as a live run writes it. A file that was being written at a cut of the power has a dot
/// before it.
bool is_file_of_a_run(std::string_view name) {
  constexpr std::array<std::string_view, 6> kWhole{"navigation.csv", "odometry.csv", "calibration.json",
                                                   kBagFileName,     "models.json",  "run.json"};
  constexpr std::array<std::string_view, 3> kOfAnImu{"calibration_", "errors_", "smoothed_"};
  if (std::find(kWhole.begin(), kWhole.end(), name) != kWhole.end()) return true;
  const bool is_capture = name == kCaptureName || (name.starts_with("capture_") && name.ends_with(".lcm"));
  return is_capture ||
         (name.ends_with(".csv") &&
          std::any_of(kOfAnImu.begin(), kOfAnImu.end(), [&](auto stem) { return name.starts_with(stem); }));
}

Descriptor open_folder(const std::filesystem::path& folder) {
  return Descriptor(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
}

Descriptor open_run(const Descriptor& parent, const std::string& name) {
  return Descriptor(openat(parent.get(), name.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
}

/// Names in an open folder, but "." and "..".
std::vector<std::string> names_in(const Descriptor& folder) {
  std::vector<std::string> names;
  const int own = openat(folder.get(), ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (own < 0) return names;
  const std::unique_ptr<DIR, int (*)(DIR*)> stream(fdopendir(own), &closedir);
  while (const dirent* entry = readdir(stream.get())) {
    const std::string name = entry->d_name;
    if (name != "." && name != "..") names.push_back(name);
  }
  return names;
}

/// Begins with the header of a run.
bool begins_as_a_run(const std::filesystem::path& run) {
  auto capture = CaptureFiles::open(run / kCaptureName);
  LogEventView event;
  return capture && capture->next(event) && event.channel.ends_with("_RUN");
}

bool lock(const Descriptor& run, int how) { return flock(run.get(), how | LOCK_NB) == 0; }

struct Content {
  std::vector<std::string> files;
  std::uint64_t bytes = 0;
  UtcTime newest{};
};

/// What is in a run that may go; nothing where it may not.
std::optional<Content> removable_content(const Descriptor& run) {
  Content content;
  bool has_capture = false;
  for (auto& name : names_in(run)) {
    struct stat file {};
    if (!is_file_of_a_run(name) || fstatat(run.get(), name.c_str(), &file, AT_SYMLINK_NOFOLLOW) != 0 ||
        !S_ISREG(file.st_mode))
      return std::nullopt;
    has_capture = has_capture || name == kCaptureName;
    constexpr std::uint64_t kBlock = 512;  // of st_blocks, whatever the file system's
    content.bytes += static_cast<std::uint64_t>(file.st_blocks) * kBlock;
    const UtcTime written{std::chrono::seconds(file.st_mtim.tv_sec) +
                          std::chrono::nanoseconds(file.st_mtim.tv_nsec)};
    content.newest = std::max(content.newest, written);
    content.files.push_back(std::move(name));
  }
  if (!has_capture) return std::nullopt;
  return content;
}

std::uint64_t bytes_of(const Descriptor& folder) {
  std::uint64_t bytes = 0;
  constexpr std::uint64_t kBlock = 512;
  for (const auto& name : names_in(folder)) {
    struct stat file {};
    if (fstatat(folder.get(), name.c_str(), &file, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(file.st_mode))
      bytes += static_cast<std::uint64_t>(file.st_blocks) * kBlock;
  }
  return bytes;
}

/// The capture last: what is left of an interrupted removal is still a run.
Result<void> remove_run(const Descriptor& parent, const std::string& name) {
  const Descriptor run = open_run(parent, name);
  const auto refused = [&] {
    return work_error(
        fmt::format("the run {} cannot be removed ({})", name, std::generic_category().message(errno)));
  };
  if (!run.is_open()) return refused();
  if (!lock(run, LOCK_EX)) return work_error(fmt::format("the run {} is being recorded", name));
  const auto content = removable_content(run);
  if (!content) return work_error(fmt::format("the run {} is somebody's now", name));
  for (const bool captures : {false, true}) {
    for (const auto& file : content->files) {
      if ((file == kCaptureName) == captures && unlinkat(run.get(), file.c_str(), 0) != 0) return refused();
    }
  }
  if (unlinkat(parent.get(), name.c_str(), AT_REMOVEDIR) != 0) return refused();
  return {};
}

bool has_limits(const RecordOptions& limits) {
  return limits.remove_older_than_s || limits.remove_beyond_bytes || limits.remove_below_free_bytes;
}

}  // namespace

Result<void> set_kept(const std::filesystem::path& run, bool kept) {
  if (!begins_as_a_run(run))
    return usage_error(fmt::format("{} is no run: it has no {} of a live run", run.string(), kCaptureName),
                       "give the folder of a run");
  const auto folder = OutputFolder::open(run);
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (!kept) {
    folder->remove(kKeptMark);
    return {};
  }
  return folder->write_whole(kKeptMark, "imuscope removes no run that has this file.\n");
}

RunLock::RunLock(const std::filesystem::path& run) : folder_(open_folder(run)) {
  if (folder_.is_open()) (void)lock(folder_, LOCK_SH);
}

std::vector<RemovableRun> removable_runs(const std::filesystem::path& folder) {
  std::vector<RemovableRun> runs;
  const Descriptor parent = open_folder(folder);
  if (!parent.is_open()) return runs;
  for (const auto& name : names_in(parent)) {
    const Descriptor run = open_run(parent, name);
    if (!run.is_open()) continue;
    const auto content = removable_content(run);
    if (!content || !lock(run, LOCK_EX) || !begins_as_a_run(folder / name)) continue;
    runs.push_back({name, content->newest, content->bytes});
  }
  std::sort(runs.begin(), runs.end(), [](const RemovableRun& a, const RemovableRun& b) {
    return std::pair(a.ended, a.name) < std::pair(b.ended, b.name);
  });
  return runs;
}

std::vector<Removal> runs_to_remove(const std::vector<RemovableRun>& runs, const RecordOptions& limits,
                                    UtcTime now, std::uint64_t all_bytes, std::uint64_t free_bytes) {
  std::vector<Removal> removals;
  const bool clock_is_set =
      std::all_of(runs.begin(), runs.end(), [&](const RemovableRun& run) { return run.ended <= now; });
  auto all = static_cast<double>(all_bytes);
  auto free = static_cast<double>(free_bytes);
  for (const auto& run : runs) {
    const double age_s = to_seconds(now - run.ended);
    std::string reason;
    if (limits.remove_older_than_s && clock_is_set && age_s > *limits.remove_older_than_s) {
      reason = fmt::format("it ended {:.1f} days ago (remove_older_than_days)", age_s / kSPerDay);
    } else if (limits.remove_beyond_bytes && all > *limits.remove_beyond_bytes) {
      reason = fmt::format("all runs had {} GB (remove_beyond_gb)",
                           digits_beside(all / kBytesPerGb, *limits.remove_beyond_bytes / kBytesPerGb));
    } else if (limits.remove_below_free_bytes && free < *limits.remove_below_free_bytes) {
      reason = fmt::format("{} GB of the disk were free (remove_below_free_gb)",
                           digits_beside(free / kBytesPerGb, *limits.remove_below_free_bytes / kBytesPerGb));
    }
    if (reason.empty()) continue;
    all -= static_cast<double>(run.bytes);
    free += static_cast<double>(run.bytes);
    removals.push_back({run, std::move(reason)});
  }
  return removals;
}

void apply_retention(const std::filesystem::path& folder, const RecordOptions& limits) {
  const Descriptor parent = open_folder(folder);
  struct statvfs disk {};
  if (!parent.is_open() || fstatvfs(parent.get(), &disk) != 0) return;
  std::uint64_t all_bytes = 0;
  for (const auto& name : names_in(parent)) {
    if (const Descriptor run = open_run(parent, name); run.is_open()) all_bytes += bytes_of(run);
  }
  const auto removals = runs_to_remove(removable_runs(folder), limits, wall_clock_now(), all_bytes,
                                       std::uint64_t{disk.f_bavail} * disk.f_frsize);
  for (const auto& removal : removals) {
    if (auto removed = remove_run(parent, removal.run.name); !removed) {
      spdlog::warn("{}", removed.error().text());
      continue;
    }
    spdlog::info("the run {} ({} GB) was removed: {}", removal.run.name,
                 digits_beside(static_cast<double>(removal.run.bytes) / kBytesPerGb, 0.0), removal.reason);
  }
}

Retention::Retention(std::filesystem::path folder, const RecordOptions& limits) {
  if (!has_limits(limits)) return;
  thread_ = std::thread([this, folder = std::move(folder), limits] {
    (void)setup_this_thread({kRetentionThreadName, Scheduling::kIdle, 0, {}});
    std::unique_lock lock(mutex_);
    do {
      lock.unlock();
      apply_retention(folder, limits);
      lock.lock();
    } while (!over_.wait_for(lock, kPeriod, [this] { return stop_; }));
  });
}

Retention::~Retention() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  // Somebody waits for it now.
  run_as(thread_, Scheduling::kNormal);
  over_.notify_all();
  thread_.join();
}

}  // namespace imuscope
