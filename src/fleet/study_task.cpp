#include "fleet/study_task.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/json_text.h"
#include "base/output_folder.h"
#include "base/text.h"
#include "fleet/attempts.h"
#include "fleet/child.h"
#include "fleet/content_hash.h"
#include "fleet/study_summary.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope::fleet {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr std::array<const char*, 5> kStates{"not yet", "studied", "refused", "gave up", "interrupted"};
/// Attempts that ended without a word are mostly not the task's fault: a campaign that is killed ten times
/// has ten.
constexpr int kLostMax = 20;
constexpr const char* kLog = "log.txt";
/// What is kept of a log to find the reason in.
constexpr std::size_t kLogMax = std::size_t{1} << 20U;
constexpr const char* kResult = "result.json";
constexpr const char* kRun = "run";

/// What a program says of a failure that another attempt, or another node, may not meet.
constexpr std::array<const char*, 9> kPassing{
    "bad_alloc",           "unexpected failure",     "No space left",
    "Input/output error",  "Stale file handle",      "Disk quota exceeded",
    "Too many open files", "Cannot allocate memory", "Resource temporarily unavailable"};

/// The last line that the program said of itself.
std::string last_words(const OutputFolder& folder) {
  std::ostringstream content;
  if (const auto log = read_text_file(folder.path() / kLog, "log", ""); log) content << *log;
  std::string text = content.str();
  if (text.size() > kLogMax) text.erase(0, text.size() - kLogMax);
  const auto at = text.rfind("imuscope: ");
  if (at == std::string::npos) return {};
  constexpr std::size_t kName = sizeof("imuscope: ") - 1;
  return one_line(text.substr(at + kName, text.find('\n', at) - at - kName));
}

/// Why an attempt has no result; empty where it has one, or a refusal.
std::string why_died(const ChildEnd& end, const std::string& words, const TaskLimits& limits) {
  if (end.timed_out) return fmt::format("took longer than {:.6g} s", limits.timeout_s);
  if (end.signal == SIGKILL) return "was killed (signal 9), as by a PC or a node that runs out of memory";
  if (end.signal != 0) return fmt::format("ended by signal {} ({})", end.signal, ::strsignal(end.signal));
  if (end.exit_code == 0) return {};
  if (words.empty()) return fmt::format("ended with code {} and no word", end.exit_code);
  const bool passing = std::any_of(kPassing.begin(), kPassing.end(),
                                   [&](const char* sign) { return words.find(sign) != std::string::npos; });
  if (!passing) return {};
  return words.find("bad_alloc") != std::string::npos ? "ran out of memory (" + words + ")" : words;
}

json result_head(const StudyTask& task, const std::string& program, TaskState state,
                 const std::string& reason) {
  return {{"schema", kStudySchema},
          {"key", task.key},
          {"program", program},
          {"state", key_of(state)},
          {"reason", reason}};
}

/// The study of one attempt, in a folder of its own that takes its place when it is whole.
class Scratch {
 public:
  /// @param name  one that is told before it is made, so that whoever finds what a killed attempt left knows whose it
  ///              was; without, one that nobody has
  static Result<Scratch> make(const StudyTask& task, const std::string& name = "") {
    const auto out = OutputFolder::open(task.out);
    if (!out) return tl::unexpected<Error>(out.error());
    const auto all = out->sub_folder("scratch");
    if (!all) return tl::unexpected<Error>(all.error());
    auto mine = name.empty() ? all->scratch_folder() : all->sub_folder(name);
    if (!mine) return tl::unexpected<Error>(mine.error());
    auto folder = mine->sub_folder(task.key);
    if (!folder) return tl::unexpected<Error>(folder.error());
    return Scratch(task, std::move(*mine), std::move(*folder));
  }
  Scratch(Scratch&&) = default;
  Scratch& operator=(Scratch&&) = delete;
  ~Scratch() {
    std::error_code error;
    if (!mine_.path().empty()) fs::remove_all(mine_.path(), error);
  }

  [[nodiscard]] const OutputFolder& folder() const { return folder_; }

  /// The result gets its place. Where another was faster, that stands: it is the same.
  [[nodiscard]] Result<void> publish(const json& result) const {
    if (auto written = folder_.write_whole(kResult, json_text(result, kJsonOneLine) + "\n"); !written)
      return written;
    const auto out = OutputFolder::open(task_->out);
    if (!out) return tl::unexpected<Error>(out.error());
    const auto studies = out->sub_folder("studies");
    if (!studies) return tl::unexpected<Error>(studies.error());
    auto taken = studies->take(mine_, task_->key);
    if (taken || study_state(task_->out, task_->key).state != TaskState::kNotYet) return {};
    // A disk that lost the end of a result.
    std::error_code error;
    fs::remove_all(studies->path() / task_->key, error);
    return studies->take(mine_, task_->key);
  }

 private:
  Scratch(const StudyTask& task, OutputFolder mine, OutputFolder folder)
      : task_(&task), mine_(std::move(mine)), folder_(std::move(folder)) {}
  const StudyTask* task_;
  OutputFolder mine_;
  OutputFolder folder_;
};

std::vector<std::string> process_command(const StudyTask& task, const fs::path& program_file,
                                         const fs::path& run) {
  // One thread: as many captures at once as there are cores take less than each of them on all cores.
  std::vector<std::string> words{
      program_file.string(), "process", task.files.front().string(), "--out", run.string(), "--threads", "1"};
  if (task.config) words.insert(words.end(), {"--config", task.config->string()});
  return words;
}

/// Rows of a run folder, which a fleet seldom looks at again; its documents and its report stay.
void remove_rows(const fs::path& run) {
  std::error_code error;
  std::vector<fs::path> rows;
  for (const auto& entry : fs::directory_iterator(run, error)) {
    if (entry.path().extension() == ".csv") rows.push_back(entry.path());
  }
  for (const auto& file : rows) fs::remove(file, error);
}

/// One attempt. kNotYet: it died.
Result<TaskOutcome> attempt_study(const StudyTask& task, const std::string& program,
                                  const fs::path& program_file, const Attempts& attempts,
                                  const std::atomic<bool>& stop) {
  auto attempt = attempts.begin(task.key, "study of " + task.name, program);
  if (!attempt) return tl::unexpected<Error>(attempt.error());
  auto scratch = Scratch::make(task, attempt->scratch);
  if (!scratch) {
    attempt->counts = false;
    (void)attempts.end(*attempt, AttemptEnd::kDied, scratch.error().text(), {});
    return tl::unexpected<Error>(scratch.error());
  }
  const fs::path run = scratch->folder().path() / kRun;
  const auto end = run_child(process_command(task, program_file, run), scratch->folder(), kLog,
                             {task.limits.memory_mb, task.limits.timeout_s}, stop);
  if (!end) {
    (void)attempts.end(*attempt, AttemptEnd::kDied, end.error().text(), {});
    return tl::unexpected<Error>(end.error());
  }
  const auto ended = [&](AttemptEnd how, TaskState state, const std::string& reason) -> Result<TaskOutcome> {
    if (auto written = attempts.end(*attempt, how, reason, *end); !written)
      return tl::unexpected<Error>(written.error());
    return TaskOutcome{state, false, reason};
  };
  if (end->stopped || end->signal == SIGTERM || end->signal == SIGINT)
    return ended(AttemptEnd::kInterrupted, TaskState::kInterrupted, "was interrupted");
  const std::string words = last_words(scratch->folder());
  const std::string died = why_died(*end, words, task.limits);
  if (!died.empty()) return ended(AttemptEnd::kDied, TaskState::kNotYet, died);
  TaskState state = end->exit_code == 0 ? TaskState::kStudied : TaskState::kRefused;
  json result = result_head(task, program, state, state == TaskState::kRefused ? words : "");
  if (state == TaskState::kStudied) {
    const auto summary = summary_of_run(run);
    if (!summary) return ended(AttemptEnd::kDied, TaskState::kNotYet, summary.error().text());
    result["summary"] = *summary;
    if (!task.keep_all_files) remove_rows(run);
  }
  if (auto published = scratch->publish(result); !published)
    return ended(AttemptEnd::kDied, TaskState::kNotYet, published.error().text());
  return ended(AttemptEnd::kDone, state, state == TaskState::kRefused ? words : "");
}

/// Why the task is not tried again; empty while it is.
std::string given_up(const StudyTask& task, const std::vector<Attempt>& attempts) {
  int died = 0;
  int lost = 0;
  std::string last;
  for (const Attempt& attempt : attempts) {
    if (!attempt.counts) continue;
    died += attempt.end == AttemptEnd::kDied ? 1 : 0;
    lost += attempt.end == AttemptEnd::kLost ? 1 : 0;
    if (attempt.end == AttemptEnd::kDied || attempt.end == AttemptEnd::kLost) last = attempt.reason;
  }
  if (died >= task.limits.attempts) return fmt::format("tried {} times: {}", died, last);
  if (lost >= kLostMax) return fmt::format("tried {} times: {}", lost, last);
  return {};
}

Result<void> check_key(const StudyTask& task, const std::string& program) {
  const auto content = sha256_of_files(task.files);
  if (!content) return tl::unexpected<Error>(content.error());
  const auto key = study_key(program, *content, task.config, task.keep_all_files);
  if (!key) return tl::unexpected<Error>(key.error());
  if (*key == task.key) return {};
  return usage_error(
      fmt::format("{}: capture, configuration or program ({}) is not what it was when the tasks were listed",
                  task.name, program),
      "list them again with the program that every node has: imuscope fleet tasks");
}

}  // namespace

const char* key_of(TaskState state) noexcept { return kStates[static_cast<std::size_t>(state)]; }

TaskOutcome study_state(const fs::path& out, const std::string& key) {
  const fs::path file = out / "studies" / key / kResult;
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return {};
  const json result = tables::read_json_file(file);
  TaskOutcome outcome;
  const auto state = std::find(kStates.begin(), kStates.end(), tables::text_at(result, "state"));
  if (state == kStates.end()) return outcome;
  outcome.state = static_cast<TaskState>(state - kStates.begin());
  outcome.was_there = true;
  outcome.reason = tables::text_at(result, "reason");
  return outcome;
}

Result<TaskOutcome> do_study(const StudyTask& task, const std::string& program, const fs::path& program_file,
                             const std::atomic<bool>& stop) {
  if (auto there = study_state(task.out, task.key); there.state != TaskState::kNotYet) return there;
  const auto attempts = Attempts::open(task.out);
  if (!attempts) return tl::unexpected<Error>(attempts.error());
  if (auto checked = check_key(task, program); !checked) {
    // Its own row, and no attempt of this task: what was listed is not what is here.
    if (auto attempt = attempts->begin(task.key, "study of " + task.name, program); attempt) {
      attempt->counts = false;
      (void)attempts->end(*attempt, AttemptEnd::kDied, checked.error().text(), {});
    }
    return tl::unexpected<Error>(checked.error());
  }
  attempts->find_lost(task.key);
  for (;;) {
    const std::string gave_up = given_up(task, attempts->of(task.key));
    if (!gave_up.empty()) {
      const auto scratch = Scratch::make(task);
      if (!scratch) return tl::unexpected<Error>(scratch.error());
      if (auto published = scratch->publish(result_head(task, program, TaskState::kGaveUp, gave_up));
          !published)
        return tl::unexpected<Error>(published.error());
      return TaskOutcome{TaskState::kGaveUp, false, gave_up};
    }
    auto outcome = attempt_study(task, program, program_file, *attempts, stop);
    if (!outcome || outcome->state != TaskState::kNotYet) return outcome;
  }
}

Result<void> forget_given_up(const fs::path& out, const std::string& key) {
  if (study_state(out, key).state != TaskState::kGaveUp) return {};
  const auto attempts = Attempts::open(out);
  if (!attempts) return tl::unexpected<Error>(attempts.error());
  if (auto forgiven = attempts->forgive(key); !forgiven) return forgiven;
  std::error_code error;
  fs::remove_all(out / "studies" / key, error);
  if (error)
    return work_error(
        fmt::format("{} cannot be removed: {}", (out / "studies" / key).string(), error.message()));
  return {};
}

}  // namespace imuscope::fleet
