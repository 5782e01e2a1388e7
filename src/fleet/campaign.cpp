#include "fleet/campaign.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "base/output_folder.h"
#include "fleet/unit_task.h"

namespace imuscope::fleet {
namespace {

/// Calls `work(i)` for every i below n, so many at once; none begins after an error or a stop.
template <typename Work>
Result<void> at_once(std::size_t n, std::size_t jobs, const std::atomic<bool>& stop, const Work& work) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::optional<Error> first;
  const auto worker = [&] {
    while (!stop.load()) {
      const std::size_t i = next.fetch_add(1);
      if (i >= n) return;
      const Result<void> done = work(i);
      if (done) continue;
      const std::lock_guard lock(mutex);
      if (!first) first = done.error();
      next.store(n);
    }
  };
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < std::min(jobs, n); ++i) threads.emplace_back(worker);
  for (auto& thread : threads) thread.join();
  if (first) return tl::unexpected<Error>(*first);
  return {};
}

/// Held while a run works in the folder.
Result<Descriptor> lock_folder(const std::filesystem::path& out) {
  Descriptor folder(::open(out.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.is_open() || ::flock(folder.get(), LOCK_EX | LOCK_NB) != 0)
    return usage_error(fmt::format("another `imuscope fleet run` works in {}", out.string()),
                       "wait for its end, or stop it");
  return folder;
}

/// Largest first: no long task is left for the end, when the other cores have nothing to do.
std::vector<const StudyTask*> in_order(const Plan& plan) {
  std::map<std::string, std::uintmax_t> bytes;
  for (const Capture& capture : plan.captures) bytes[capture.key] = capture.bytes;
  std::vector<const StudyTask*> tasks;
  for (const StudyTask& task : plan.studies) tasks.push_back(&task);
  std::stable_sort(tasks.begin(), tasks.end(),
                   [&](const StudyTask* a, const StudyTask* b) { return bytes[a->key] > bytes[b->key]; });
  return tasks;
}

}  // namespace

CampaignCount count_results(const Plan& plan) {
  CampaignCount count;
  count.captures = plan.captures.size();
  count.not_studied = plan.captures.size() - plan.studies.size();
  for (const StudyTask& task : plan.studies) {
    switch (study_state(task.out, task.key).state) {
      case TaskState::kStudied:
        ++count.studied;
        break;
      case TaskState::kRefused:
        ++count.refused;
        break;
      case TaskState::kGaveUp:
        ++count.gave_up;
        break;
      case TaskState::kNotYet:
      case TaskState::kInterrupted:
        ++count.not_yet;
        break;
    }
  }
  count.units = plan.units.size();
  for (const UnitTask& task : plan.units) count.units_done += unit_is_done(task) ? 1 : 0;
  return count;
}

std::string words_of(const CampaignCount& count) {
  std::string words = fmt::format("{} of {} captures studied", count.studied, count.captures);
  const auto add = [&](std::size_t n, const char* what) {
    if (n > 0) words += fmt::format(", {} {}", n, what);
  };
  add(count.refused, "refused");
  add(count.gave_up, "given up");
  add(count.not_yet, "not yet studied");
  add(count.not_studied, "not to be studied");
  return words + fmt::format("; {} of {} units", count.units_done, count.units);
}

Result<void> run_campaign(const Plan& plan, const RunOptions& options, const std::atomic<bool>& stop) {
  if (plan.studies.empty()) return {};
  const auto lock = lock_folder(plan.studies.front().out);
  if (!lock) return tl::unexpected<Error>(lock.error());
  const auto tasks = in_order(plan);
  std::mutex mutex;
  std::size_t ended = 0;
  auto studied = at_once(tasks.size(), options.jobs, stop, [&](std::size_t i) -> Result<void> {
    const StudyTask& task = *tasks[i];
    if (options.retry) {
      if (auto forgotten = forget_given_up(task.out, task.key); !forgotten) return forgotten;
    }
    const auto outcome = do_study(task, plan.program, options.program_file, stop);
    const std::lock_guard guard(mutex);
    ++ended;
    // What is wrong with one task is its own: the others go on.
    const TaskOutcome told =
        outcome ? *outcome : TaskOutcome{TaskState::kNotYet, false, outcome.error().text()};
    if (options.on_end) options.on_end(task, told, ended, tasks.size());
    return {};
  });
  if (!studied || stop.load()) return studied;
  return at_once(plan.units.size(), options.jobs, stop,
                 [&](std::size_t i) { return do_unit(plan.units[i], plan.program); });
}

}  // namespace imuscope::fleet
