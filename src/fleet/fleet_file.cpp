#include "fleet/fleet_file.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <utility>

#include "base/text.h"
#include "configuration/toml_depth.h"
#include "configuration/toml_reader.h"

namespace imuscope::fleet {
namespace {

constexpr int kTomlAttemptsMax = 100;
constexpr double kMemoryMin_mb = 64.0;
constexpr double kMemoryMax_mb = 1e7;
constexpr double kTimeoutMin_min = 0.01;
constexpr double kTimeoutMax_min = 1e6;
constexpr double kSecondsPerMinute = 60.0;
/// Nobody asks for a unit that is a hundred times as noisy as its certificate.
constexpr double kFactorMax = 100.0;
constexpr std::size_t kKept = 0;

std::filesystem::path beside(const std::filesystem::path& file, const std::string& path) {
  return (file.parent_path() / path).lexically_normal();
}

void read_mounting(TomlReader in, std::vector<MountingCampaign>& mountings) {
  MountingCampaign mounting;
  in.text("vehicle", mounting.vehicle);
  in.require("vehicle", "name the vehicle");
  in.text("name", mounting.name);
  in.texts("captures", mounting.captures);
  if (mounting.captures.empty()) mounting.captures = {"*"};
  auto units = in.table("units");
  units.every_text(mounting.units);
  units.finish();
  in.finish();
  mountings.push_back(std::move(mounting));
}

void read_unit(TomlReader in, const std::filesystem::path& file, FleetFile& fleet) {
  std::string serial;
  std::string certificate;
  in.text("serial", serial);
  in.require("serial", "the number on the unit's label");
  in.text("certificate", certificate);
  in.finish();
  if (!certificate.empty()) fleet.certificates[serial] = beside(file, certificate);
}

/// Calls `read` with every table of the list `key`.
template <typename Read>
void each_table(TomlReader& root, const char* key, TomlProblem& problem, const Read& read) {
  const toml::array* list = root.array(key);
  if (list == nullptr) return;
  for (const toml::node& node : *list) {
    if (!node.is_table()) {
      root.fail(key, "is no list of tables", fmt::format("begin each with [[{}]]", key));
      return;
    }
    read(TomlReader(node.as_table(), key, problem));
  }
}

void read_tasks(TomlReader in, TaskLimits& limits) {
  in.integer("attempts", limits.attempts, 1, kTomlAttemptsMax);
  std::optional<double> memory_mb;
  std::optional<double> timeout_s;
  in.number("memory_mb", memory_mb, 1.0, kMemoryMin_mb, kMemoryMax_mb);
  in.number("timeout_min", timeout_s, kSecondsPerMinute, kTimeoutMin_min, kTimeoutMax_min);
  limits.memory_mb = memory_mb.value_or(0.0);
  limits.timeout_s = timeout_s.value_or(0.0);
  in.finish();
}

void read_study(TomlReader in, const std::filesystem::path& file, FleetFile& fleet) {
  std::string config;
  in.text("config", config);
  if (!config.empty()) fleet.config = beside(file, config);
  fleet.keep_all_files = in.choice("files", {"report", "all"}, kKept) != kKept;
  in.finish();
}

void read_root(TomlReader& root, TomlProblem& problem, FleetFile& fleet) {
  auto head = root.table("fleet");
  fleet.name = fleet.file.stem().string();
  head.text("name", fleet.name);
  std::vector<std::string> captures;
  head.texts("captures", captures);
  head.require("captures", "folders and files, such as [\"captures\"]");
  for (const auto& path : captures) fleet.captures.push_back(beside(fleet.file, path));
  std::string out = "campaign";
  head.text("out", out);
  fleet.out = beside(fleet.file, out);
  head.finish();
  read_study(root.table("study"), fleet.file, fleet);
  read_tasks(root.table("tasks"), fleet.limits);
  auto certificate = root.table("certificate");
  certificate.number("factor", fleet.certificate_factor, 1.0, 1.0, kFactorMax);
  certificate.finish();
  each_table(root, "mounting", problem,
             [&](TomlReader in) { read_mounting(std::move(in), fleet.mountings); });
  each_table(root, "unit", problem, [&](TomlReader in) { read_unit(std::move(in), fleet.file, fleet); });
  root.finish();
}

}  // namespace

Result<FleetFile> read_fleet_file(const std::filesystem::path& file) {
  const auto content = read_text_file(file, "description of a fleet",
                                      "give the path of a fleet.toml; docs/fleet.md shows one");
  if (!content) return tl::unexpected<Error>(content.error());
  if (has_key_too_deep(*content))
    return usage_error(fmt::format("{}: a key has more than {} words", file.string(), kTomlDepthMax));
  toml::table document;
  try {
    document = toml::parse(*content, file.string());
  } catch (const toml::parse_error& error) {
    return usage_error(
        fmt::format("{}:{}: not TOML: {}", file.string(), error.source().begin.line, error.description()),
        "docs/fleet.md shows an example");
  }
  FleetFile fleet;
  std::error_code error;
  fleet.file = std::filesystem::absolute(file, error).lexically_normal();
  if (error) return usage_error(fmt::format("{}: {}", file.string(), error.message()));
  TomlProblem problem{file.string(), std::nullopt, nullptr};
  TomlReader root(&document, "", problem);
  read_root(root, problem, fleet);
  if (problem.error) return tl::unexpected<Error>(*problem.error);
  if (fleet.captures.empty())
    return usage_error(fmt::format("{}: fleet.captures is empty", file.string()),
                       "name a folder of captures");
  if (fleet.mountings.empty()) fleet.mountings.push_back({fleet.name, "", {"*"}, {}});
  return fleet;
}

std::optional<std::size_t> mounting_of(const FleetFile& fleet, const std::string& capture) {
  for (std::size_t i = 0; i < fleet.mountings.size(); ++i) {
    const auto& patterns = fleet.mountings[i].captures;
    if (std::any_of(patterns.begin(), patterns.end(), [&](const std::string& pattern) {
          return ::fnmatch(pattern.c_str(), capture.c_str(), 0) == 0;
        }))
      return i;
  }
  return std::nullopt;
}

std::string unit_of(const MountingCampaign& mounting, const std::string& device) {
  const auto found = mounting.units.find(device);
  return found == mounting.units.end() ? mounting.vehicle + "/" + device : found->second;
}

}  // namespace imuscope::fleet
