#pragma once

/// What was tried: one file per attempt, written when it begins and again when it ends. They are no part of
/// the results; whoever died without a word leaves one that only began.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "fleet/child.h"

namespace imuscope::fleet {

/// How an attempt ended.
enum class AttemptEnd : std::uint8_t {
  kRunning,      ///< it began; or whoever made it died without a word
  kDone,         ///< with a result
  kDied,         ///< by itself, without one: memory, a signal, time, a disk
  kInterrupted,  ///< by a person, or the workflow manager
  kLost,         ///< found to have died without a word: the node, or the whole campaign
};

/// "running", "done", "died", "interrupted", "lost".
const char* key_of(AttemptEnd end) noexcept;

struct Attempt {
  std::string key;  ///< of the task
  int number = 1;   ///< from 1
  std::string task;
  std::string program;
  std::string host;
  std::int64_t process = 0;
  std::int64_t process_start =
      0;                ///< in ticks since the PC started: tells a process from a later one of its number
  std::string scratch;  ///< the folder below OUT/scratch that it works in
  std::string began_utc;
  std::string ended_utc;
  AttemptEnd end = AttemptEnd::kRunning;
  std::string reason;
  double wall_s = 0.0;
  double cpu_s = 0.0;
  double peak_mb = 0.0;
  bool counts = true;  ///< false: forgiven, so that the task may be tried again
};

/// The attempts of a campaign: OUT/attempts.
class Attempts {
 public:
  static Result<Attempts> open(const std::filesystem::path& out);

  /// Writes down that an attempt began; its number is the next of the task, whoever else begins one.
  /// Its scratch folder has a name, and is not there yet: whatever kills it leaves nothing that nobody knows of.
  [[nodiscard]] Result<Attempt> begin(const std::string& key, const std::string& task,
                                      const std::string& program) const;
  /// Writes down how it ended.
  [[nodiscard]] Result<void> end(Attempt& attempt, AttemptEnd how, const std::string& reason,
                                 const ChildEnd& used) const;

  /// Those of one task, oldest first.
  [[nodiscard]] std::vector<Attempt> of(const std::string& key) const;
  /// All of the campaign, by key and number.
  [[nodiscard]] std::vector<Attempt> all() const;
  /// Makes up for a lost word: attempts of this PC whose process is gone are kLost, and their scratch folders
  /// are removed.
  void find_lost(const std::string& key) const;
  /// The task's attempts do not count any more.
  [[nodiscard]] Result<void> forgive(const std::string& key) const;

 private:
  Attempts(OutputFolder folder, std::filesystem::path scratch)
      : folder_(std::move(folder)), scratch_(std::move(scratch)) {}
  [[nodiscard]] Result<void> write(const Attempt& attempt) const;

  OutputFolder folder_;
  std::filesystem::path scratch_;
};

/// The name of a file of OUT/attempts.
std::string attempt_file(const std::string& key, int number);

}  // namespace imuscope::fleet
