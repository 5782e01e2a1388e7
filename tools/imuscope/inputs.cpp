#include "inputs.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>

#include "findings.h"
#include "progress.h"

namespace imuscope::cli {

namespace {

/// @param findings  of a look at the data; null: none is taken
Result<OpenedRecording> open(const std::vector<std::string>& inputs, const std::string& config,
                             std::vector<check::Finding>* findings) {
  std::optional<std::filesystem::path> file;
  if (!config.empty()) file = config;
  ProgressBar bar;
  return open_recording(
      inputs, file, [&](const std::string& what, double share) { bar.show(what, share); }, findings);
}

void log_remarks(const OpenedRecording& opened) {
  const auto& damage = opened.recording.damage;
  for (const auto& remark : opened.remarks) {
    const bool is_damage = std::find(damage.begin(), damage.end(), remark) != damage.end();
    spdlog::log(is_damage ? spdlog::level::warn : spdlog::level::info, "{}", remark);
  }
}

}  // namespace

void add_inputs(CLI::App& command, std::vector<std::string>& inputs, std::string& config) {
  command.add_option("input", inputs, "a capture, or raw dumps as NAME=FILE (NAME of a device)")
      ->required()
      ->type_name("INPUT");
  command.add_option("--config,-c", config, "configuration (TOML); a capture holds its own")
      ->type_name("FILE");
}

Result<OpenedRecording> open_inputs(const std::vector<std::string>& inputs, const std::string& config) {
  auto opened = open(inputs, config, nullptr);
  if (opened) log_remarks(*opened);
  return opened;
}

Result<OpenedRecording> open_and_look(const std::vector<std::string>& inputs, const std::string& config,
                                      bool quiet) {
  std::vector<check::Finding> findings;
  auto opened = open(inputs, config, &findings);
  if (!quiet) print_findings(findings);
  if (!opened) return tl::unexpected<Error>(explained(opened.error(), findings));
  opened->findings = std::move(findings);
  log_remarks(*opened);
  return opened;
}

}  // namespace imuscope::cli
