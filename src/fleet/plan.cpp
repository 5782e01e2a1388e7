#include "fleet/plan.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.h"
#include "base/missing_file.h"
#include "base/output_folder.h"
#include "base/text.h"
#include "capture/capture_files.h"
#include "fleet/content_hash.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope::fleet {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kCaptureExtension = ".lcm";
constexpr const char* kHashes = "hashes.json";
constexpr const char* kHashSchema = "imuscope.fleet-hashes/1";
constexpr std::size_t kNumberDigits = 3;

/// The first file of the capture that `file` may go on, by its name: "run_001.lcm" goes on "run.lcm".
std::optional<fs::path> goes_on(const fs::path& file) {
  const std::string stem = file.stem().string();
  if (stem.size() < kNumberDigits + 2 || stem[stem.size() - kNumberDigits - 1] != '_') return std::nullopt;
  const std::string digits = stem.substr(stem.size() - kNumberDigits);
  if (!std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return std::nullopt;
  auto first = file;
  first.replace_filename(stem.substr(0, stem.size() - kNumberDigits - 1) + file.extension().string());
  return first;
}

/// Captures below a folder by their names there, each with all its files in order.
Result<std::map<std::string, std::vector<fs::path>>> captures_below(const fs::path& folder,
                                                                    const fs::path& out) {
  std::error_code error;
  std::set<fs::path> found;
  fs::recursive_directory_iterator each(folder, fs::directory_options::follow_directory_symlink, error);
  for (; !error && each != fs::recursive_directory_iterator(); each.increment(error)) {
    if (each->path() == out) {
      each.disable_recursion_pending();
      continue;
    }
    if (each->path().extension() == kCaptureExtension && each->is_regular_file(error))
      found.insert(each->path());
  }
  if (error) return work_error(fmt::format("{} cannot be searched: {}", folder.string(), error.message()));
  std::map<std::string, std::vector<fs::path>> captures;
  for (const auto& file : found) {
    const auto first = goes_on(file);
    const auto& of = first && found.count(*first) > 0 ? *first : file;
    captures[of.lexically_relative(folder).generic_string()].push_back(file);
  }
  // The first file of a capture may stand after its numbered ones in the order of the alphabet.
  for (auto& [name, files] : captures)
    std::stable_sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
      return a.string().size() < b.string().size();
    });
  return captures;
}

Result<std::vector<Capture>> find_captures(const FleetFile& fleet) {
  std::map<std::string, std::vector<fs::path>> all;
  for (const auto& place : fleet.captures) {
    std::error_code error;
    const auto status = fs::status(place, error);
    if (!fs::exists(status))
      return tl::unexpected<Error>(
          explain_missing(place.string(), error, "mend fleet.captures of " + fleet.file.string()));
    std::map<std::string, std::vector<fs::path>> found;
    if (fs::is_directory(status)) {
      auto below = captures_below(place, fleet.out);
      if (!below) return tl::unexpected<Error>(below.error());
      found = std::move(*below);
    } else {
      found[place.filename().string()] = {place};
      for (int n = 1; fs::is_regular_file(capture_file(place, n), error); ++n)
        found[place.filename().string()].push_back(capture_file(place, n));
    }
    for (auto& [name, files] : found) {
      if (!all.emplace(name, std::move(files)).second)
        return usage_error(fmt::format("two captures are called {}", one_line(name)),
                           "name the folder above both in fleet.captures");
    }
  }
  if (all.empty())
    return usage_error(fmt::format("{}: no capture (*{}) was found", fleet.file.string(), kCaptureExtension),
                       "imuscope import makes captures of other recordings");
  std::vector<Capture> captures;
  for (auto& [name, files] : all) {
    Capture capture;
    capture.name = one_line(name);
    capture.files = std::move(files);
    captures.push_back(std::move(capture));
  }
  return captures;
}

/// What tells whether a file is the one whose hash is known.
json stamp_of(const std::vector<fs::path>& files, std::uintmax_t& bytes) {
  json stamps = json::array();
  bytes = 0;
  for (const auto& file : files) {
    struct stat status {};
    if (::stat(file.c_str(), &status) != 0) return nullptr;
    bytes += static_cast<std::uintmax_t>(status.st_size);
    stamps.push_back(
        {file.string(), status.st_size, status.st_ino, status.st_mtim.tv_sec, status.st_mtim.tv_nsec});
  }
  return stamps;
}

Result<void> hash_captures(std::vector<Capture>& captures, const OutputFolder& out) {
  const json kept = tables::read_json_file(out.path() / kHashes);
  const json& known = tables::field(kept, "captures");
  std::vector<json> stamps(captures.size());
  std::vector<std::optional<Error>> errors(captures.size());
  tbb::parallel_for(std::size_t{0}, captures.size(), [&](std::size_t i) {
    Capture& capture = captures[i];
    stamps[i] = stamp_of(capture.files, capture.bytes);
    const json& before = tables::field(known, capture.name.c_str());
    if (!stamps[i].is_null() && tables::field(before, "files") == stamps[i]) {
      capture.sha256 = tables::text_at(before, "sha256");
      return;
    }
    const auto hash = sha256_of_files(capture.files);
    if (hash) {
      capture.sha256 = *hash;
    } else {
      errors[i] = hash.error();
    }
  });
  json all = json::object();
  for (std::size_t i = 0; i < captures.size(); ++i) {
    if (errors[i]) {
      captures[i].not_studied = errors[i]->text();
      continue;
    }
    all[captures[i].name] = {{"files", stamps[i]}, {"sha256", captures[i].sha256}};
  }
  if (all == known) return {};
  return out.write_whole(kHashes,
                         json_text({{"schema", kHashSchema}, {"captures", all}}, kJsonOneLine) + "\n");
}

/// Which studies there are; of captures of one content the first is studied.
Result<void> plan_studies(const FleetFile& fleet, Plan& plan) {
  std::map<std::string, std::string> first_of;
  for (Capture& capture : plan.captures) {
    if (!capture.not_studied.empty()) continue;
    capture.mounting = mounting_of(fleet, capture.name);
    if (!capture.mounting) {
      capture.not_studied = "no [[mounting]] of the fleet's file takes it";
      continue;
    }
    const auto [same, is_new] = first_of.emplace(capture.sha256, capture.name);
    if (!is_new) {
      capture.not_studied = "has the content of " + same->second;
      continue;
    }
    const auto key = study_key(plan.program, capture.sha256, fleet.config, fleet.keep_all_files);
    if (!key) return tl::unexpected<Error>(key.error());
    capture.key = *key;
    plan.studies.push_back(
        {fleet.out, *key, capture.name, capture.files, fleet.config, fleet.keep_all_files, fleet.limits});
  }
  return {};
}

}  // namespace

Result<std::string> study_key(const std::string& program, const std::string& capture_sha256,
                              const std::optional<fs::path>& config, bool keep_all_files) {
  std::string configuration;
  if (config) {
    const auto text = read_text_file(*config, "configuration", "mend study.config of the fleet's file");
    if (!text) return tl::unexpected<Error>(text.error());
    configuration = *text;
  }
  return key_of({"imuscope.fleet-study/1", program, capture_sha256, config ? "given" : "its own",
                 configuration, keep_all_files ? "all files" : "report"});
}

Result<Plan> plan_campaign(const FleetFile& fleet, const std::string& program) {
  const auto out = OutputFolder::open(fleet.out);
  if (!out) return tl::unexpected<Error>(out.error());
  Plan plan;
  plan.program = program;
  auto captures = find_captures(fleet);
  if (!captures) return tl::unexpected<Error>(captures.error());
  plan.captures = std::move(*captures);
  if (auto hashed = hash_captures(plan.captures, *out); !hashed) return tl::unexpected<Error>(hashed.error());
  if (auto planned = plan_studies(fleet, plan); !planned) return tl::unexpected<Error>(planned.error());
  // Which devices a capture holds is known to its configuration alone; a unit is planned where the file names
  // it.
  std::map<std::string, UnitTask> units;
  for (const Capture& capture : plan.captures) {
    if (capture.key.empty()) continue;
    const MountingCampaign& mounting = fleet.mountings[*capture.mounting];
    for (const auto& [device, unit] : mounting.units)
      units[unit].drives.push_back({capture.key, device, mounting.vehicle + "/" + mounting.name});
  }
  for (auto& [unit, task] : units) {
    task.out = fleet.out;
    task.unit = unit;
    std::vector<std::string> parts{"imuscope.fleet-unit/1", plan.program, unit};
    for (const auto& drive : task.drives)
      parts.insert(parts.end(), {drive.study_key, drive.device, drive.mounting});
    task.key = key_of(parts);
    plan.units.push_back(std::move(task));
  }
  return plan;
}

std::vector<std::string> command_of(const StudyTask& task) {
  std::vector<std::string> words{"imuscope", "fleet",           "study",
                                 "--out",    task.out.string(), "--key",
                                 task.key,   "--attempts",      std::to_string(task.limits.attempts)};
  if (task.config) words.insert(words.end(), {"--config", task.config->string()});
  if (task.keep_all_files) words.emplace_back("--keep-all");
  if (task.limits.memory_mb > 0.0)
    words.insert(words.end(), {"--memory-mb", fmt::format("{}", task.limits.memory_mb)});
  if (task.limits.timeout_s > 0.0)
    words.insert(words.end(), {"--timeout-s", fmt::format("{}", task.limits.timeout_s)});
  words.insert(words.end(), {"--name", task.name, "--"});
  for (const auto& file : task.files) words.push_back(file.string());
  return words;
}

std::vector<std::string> command_of(const UnitTask& task) {
  std::vector<std::string> words{"imuscope", "fleet",  "unit",   "--out",   task.out.string(),
                                 "--key",    task.key, "--unit", task.unit, "--"};
  for (const auto& drive : task.drives)
    words.push_back(fmt::format("{}={}={}", drive.study_key, drive.device, drive.mounting));
  return words;
}

std::string shell_line(const std::vector<std::string>& words) {
  std::string line;
  for (const auto& word : words) {
    if (!line.empty()) line += ' ';
    const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
             std::string_view("-_./=+,:@").find(c) != std::string_view::npos;
    });
    if (plain) {
      line += word;
      continue;
    }
    line += '\'';
    for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += '\'';
  }
  return line;
}

}  // namespace imuscope::fleet
