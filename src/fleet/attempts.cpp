#include "fleet/attempts.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/json_text.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope::fleet {
namespace {

using nlohmann::json;

constexpr const char* kSchema = "imuscope.fleet-attempt/1";
constexpr std::array<const char*, 5> kEnds{"running", "done", "died", "interrupted", "lost"};
/// No task is tried more often.
constexpr int kAttemptsMax = 10000;
constexpr std::size_t kHostMax = 256;
/// proc_pid_stat(5): the field of the start, counted after the closing bracket of the name.
constexpr int kStartBehindName = 20;

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}

std::string host_name() {
  std::array<char, kHostMax> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

/// Absent where there is no such process.
std::optional<std::int64_t> start_of(std::int64_t process) {
  std::ifstream in(fmt::format("/proc/{}/stat", process));
  std::string line;
  if (!std::getline(in, line)) return std::nullopt;
  const auto bracket = line.rfind(')');
  if (bracket == std::string::npos) return std::nullopt;
  std::istringstream rest(line.substr(bracket + 1));
  std::string field;
  for (int i = 0; i < kStartBehindName && rest >> field; ++i) {
  }
  try {
    return std::stoll(field);
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

json to_json(const Attempt& attempt) {
  return {{"schema", kSchema},
          {"key", attempt.key},
          {"number", attempt.number},
          {"task", attempt.task},
          {"program", attempt.program},
          {"host", attempt.host},
          {"process", attempt.process},
          {"process_start", attempt.process_start},
          {"scratch", attempt.scratch},
          {"began_utc", attempt.began_utc},
          {"ended_utc", attempt.ended_utc},
          {"end", key_of(attempt.end)},
          {"reason", attempt.reason},
          {"wall_s", attempt.wall_s},
          {"cpu_s", attempt.cpu_s},
          {"peak_mb", attempt.peak_mb},
          {"counts", attempt.counts}};
}

std::optional<Attempt> from_json(const json& document) {
  using tables::number_at;
  using tables::text_at;
  if (text_at(document, "schema") != kSchema) return std::nullopt;
  Attempt attempt;
  attempt.key = text_at(document, "key");
  attempt.number = static_cast<int>(number_at(document, "number").value_or(0.0));
  attempt.task = text_at(document, "task");
  attempt.program = text_at(document, "program");
  attempt.host = text_at(document, "host");
  attempt.process = static_cast<std::int64_t>(number_at(document, "process").value_or(0.0));
  attempt.process_start = static_cast<std::int64_t>(number_at(document, "process_start").value_or(0.0));
  attempt.scratch = text_at(document, "scratch");
  attempt.began_utc = text_at(document, "began_utc");
  attempt.ended_utc = text_at(document, "ended_utc");
  const auto end = std::find(kEnds.begin(), kEnds.end(), text_at(document, "end"));
  if (end == kEnds.end()) return std::nullopt;
  attempt.end = static_cast<AttemptEnd>(end - kEnds.begin());
  attempt.reason = text_at(document, "reason");
  attempt.wall_s = number_at(document, "wall_s").value_or(0.0);
  attempt.cpu_s = number_at(document, "cpu_s").value_or(0.0);
  attempt.peak_mb = number_at(document, "peak_mb").value_or(0.0);
  attempt.counts = text_at(document, "counts") != "false";
  return attempt;
}

}  // namespace

const char* key_of(AttemptEnd end) noexcept { return kEnds[static_cast<std::size_t>(end)]; }

std::string attempt_file(const std::string& key, int number) {
  return fmt::format("{}-{:04}.json", key, number);
}

Result<Attempts> Attempts::open(const std::filesystem::path& out) {
  const auto folder = OutputFolder::open(out);
  if (!folder) return tl::unexpected<Error>(folder.error());
  auto attempts = folder->sub_folder("attempts");
  if (!attempts) return tl::unexpected<Error>(attempts.error());
  return Attempts(std::move(*attempts), out / "scratch");
}

Result<void> Attempts::write(const Attempt& attempt) const {
  return folder_.write_whole(attempt_file(attempt.key, attempt.number), json_text(to_json(attempt)) + "\n");
}

Result<Attempt> Attempts::begin(const std::string& key, const std::string& task,
                                const std::string& program) const {
  Attempt attempt;
  attempt.key = key;
  attempt.task = task;
  attempt.program = program;
  attempt.host = host_name();
  attempt.process = ::getpid();
  attempt.process_start = start_of(attempt.process).value_or(0);
  attempt.began_utc = utc_now();
  for (; attempt.number <= kAttemptsMax; ++attempt.number) {
    // Whoever makes the file has the number.
    if (folder_.create_new(attempt_file(key, attempt.number)).is_open()) {
      attempt.scratch = fmt::format("{}.{}", key, attempt.number);
      if (auto written = write(attempt); !written) return tl::unexpected<Error>(written.error());
      return attempt;
    }
    if (errno != EEXIST)
      return work_error(
          fmt::format("{} cannot be written: {}", folder_.path().string(), std::strerror(errno)));
  }
  return work_error(fmt::format("task {} was tried {} times", key, kAttemptsMax));
}

Result<void> Attempts::end(Attempt& attempt, AttemptEnd how, const std::string& reason,
                           const ChildEnd& used) const {
  attempt.end = how;
  attempt.reason = reason;
  attempt.ended_utc = utc_now();
  attempt.wall_s = used.wall_s;
  attempt.cpu_s = used.cpu_s;
  attempt.peak_mb = used.peak_mb;
  return write(attempt);
}

std::vector<Attempt> Attempts::of(const std::string& key) const {
  std::vector<Attempt> found;
  for (int number = 1; number <= kAttemptsMax; ++number) {
    const auto file = folder_.path() / attempt_file(key, number);
    std::error_code error;
    if (!std::filesystem::exists(file, error)) break;
    if (auto attempt = from_json(tables::read_json_file(file))) {
      found.push_back(std::move(*attempt));
    } else {
      // Begun, and killed before it could say so.
      Attempt lost;
      lost.key = key;
      lost.number = number;
      lost.end = AttemptEnd::kLost;
      lost.reason = "ended without a word before it began";
      found.push_back(std::move(lost));
    }
  }
  return found;
}

std::vector<Attempt> Attempts::all() const {
  std::vector<Attempt> found;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path(), error)) {
    if (auto attempt = from_json(tables::read_json_file(entry.path()))) found.push_back(std::move(*attempt));
  }
  std::sort(found.begin(), found.end(), [](const Attempt& a, const Attempt& b) {
    return std::tie(a.key, a.number) < std::tie(b.key, b.number);
  });
  return found;
}

void Attempts::find_lost(const std::string& key) const {
  const std::string here = host_name();
  for (Attempt& attempt : of(key)) {
    if (attempt.end != AttemptEnd::kRunning || attempt.host != here) continue;
    if (start_of(attempt.process) == attempt.process_start) continue;
    attempt.end = AttemptEnd::kLost;
    attempt.reason = "ended without a word: it was killed, or the PC stopped";
    (void)write(attempt);
    std::error_code error;
    if (!attempt.scratch.empty() && attempt.scratch.find('/') == std::string::npos)
      std::filesystem::remove_all(scratch_ / attempt.scratch, error);
  }
}

Result<void> Attempts::forgive(const std::string& key) const {
  for (Attempt& attempt : of(key)) {
    if (!attempt.counts || attempt.task.empty()) continue;
    attempt.counts = false;
    if (auto written = write(attempt); !written) return written;
  }
  return {};
}

}  // namespace imuscope::fleet
