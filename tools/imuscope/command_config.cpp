#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>

#include "commands.h"
#include "configuration/config.h"
#include "configuration/config_reference.h"
#include "findings.h"
#include "print.h"

namespace imuscope::cli {

namespace {

/// In a cell of a Markdown table.
std::string code(const std::string& text) { return fmt::format("`{}`", text); }

void print_reference() {
  say("# Configuration\n\n"
      "This page is what `imuscope config` prints. Angles are in degrees and times in milliseconds where "
      "the key says so. A key that does not exist is refused with the nearest one that does. "
      "`[device.noise]` and its like belong to the `[[device]]` above them. Where the last column is empty, "
      "a key that is left out is off, or what it says is taken as three MTx beside an Airins have it. "
      "`config/` holds configurations to begin with; `imuscope config FILE` checks one; `[simulation]` is "
      "for `imusim` alone, and `config/demo.toml` shows it.\n");
  std::string table;
  for (const auto& key : configuration_reference()) {
    const auto dot = key.name.rfind('.');
    if (key.name.substr(0, dot) != table) {
      table = key.name.substr(0, dot);
      say("\n## `{}`\n\n| key | what it is | values | without it |\n|---|---|---|---|\n",
          table == "device" ? "[[device]]" : fmt::format("[{}]", table));
    }
    std::vector<std::string> presets;
    for (const auto& preset : key.presets) presets.push_back(code(preset));
    if (key.required) presets = {"must be given"};
    say("| `{}` | {} | {} | {} |\n", key.name.substr(dot + 1), key.about, key.values,
        fmt::join(presets, ", "));
  }
}

Result<void> check(const std::filesystem::path& file) {
  const auto configuration = load_configuration(file);
  if (!configuration) return tl::unexpected<Error>(configuration.error());
  say("{}: good, {} devices\n", file.string(), configuration->devices.size());
  for (const auto& device : configuration->devices) {
    say("  {:<12} {:<10} {:<14} {:g} Hz\n", device.name, name_of(device.role), name_of(device.protocol),
        device.rate_hz);
  }
  return {};
}

/// The configuration held against a recording.
Result<void> check_with_data(const std::filesystem::path& file, const std::vector<std::string>& data,
                             const std::filesystem::path& fix) {
  std::vector<check::Finding> findings;
  const auto opened = open_recording(data, file, {}, &findings);
  print_findings(findings);
  if (!fix.empty()) {
    const auto configuration = load_configuration(file);
    if (!configuration) return tl::unexpected<Error>(configuration.error());
    if (auto written = write_fixed(*configuration, findings, fix); !written) return written;
  }
  if (!opened) return tl::unexpected<Error>(explained(opened.error(), findings));
  if (harm_in_short(findings).empty()) {
    say("{}: nothing in the data speaks against it\n", file.string());
    return {};
  }
  return work_error("the data and the configuration do not fit", "the findings above say what to correct");
}

struct ConfigCommand {
  std::filesystem::path file;
  std::vector<std::string> data;
  std::filesystem::path fix;
};

}  // namespace

void add_config(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("config", "Check a configuration, or print what can stand in one (Markdown)");
  auto options = std::make_shared<ConfigCommand>();
  command->add_option("CONFIG", options->file,
                      "Configuration to check; without it, the reference of all keys is printed");
  auto* data = command
                   ->add_option("--data", options->data,
                                "a recording to hold it against: a capture, or raw dumps as NAME=FILE")
                   ->type_name("INPUT");
  command
      ->add_option("--fix", options->fix,
                   "write a copy of it with the lines corrected that the data show to be wrong")
      ->type_name("FILE")
      ->needs(data);
  on_chosen(*command, chosen, [options]() -> Result<void> {
    if (!options->data.empty() && options->file.empty())
      return usage_error("--data needs the configuration that the data are held against",
                         "give CONFIG before it");
    if (auto checked = options->file.empty() ? Result<void>{} : check(options->file); !checked)
      return checked;
    if (!options->data.empty()) return check_with_data(options->file, options->data, options->fix);
    if (options->file.empty()) print_reference();
    return {};
  });
}

}  // namespace imuscope::cli
