#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <memory>
#include <utility>

#include "commands.h"
#include "findings.h"
#include "print.h"
#include "progress.h"
#include "service/intake/import.h"

namespace imuscope::cli {
namespace {

struct ImportCommand {
  std::vector<std::string> inputs;
  std::string out;
  std::string config;
};

Result<Imported> with_progress(ImportOptions import) {
  ProgressBar bar;
  import.progress = [&bar](double share) { bar.show("importing", share);
};
return import_recording(import);
}  // namespace

Result<void> import_files(const ImportCommand& options) {
  ImportOptions import;
  import.inputs = options.inputs;
  import.out = options.out;
  import.version = IMUSCOPE_VERSION;
  if (!options.config.empty()) import.configuration = options.config;
  const auto imported = with_progress(std::move(import));
  if (!imported) return tl::unexpected<Error>(imported.error());
  for (const auto& remark : imported->remarks) spdlog::info("{}", remark);
  if (imported->drafted)
    spdlog::warn("the configuration was drafted from the files; give your own with --config, or with replay");
  for (const auto& device : imported->devices)
    say("{:<12} {:>10} bytes in {} reads; times: {}\n", device.name, device.bytes, device.reads,
        device.times);
  print_look(look_at_capture(options.out));
  return {};
}

}  // namespace imuscope::cli

void add_import(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("import", "Raw dumps and logs into one capture");
  auto options = std::make_shared<ImportCommand>();
  command
      ->add_option(
          "NAME=FILE", options->inputs,
          "recording of each device: raw bytes (with NAME.arrivals.csv beside it where the arrivals "
          "were kept), .mtb, .pos, or a file of many topics: MCAP, ROS bag, PX4 ULog, ArduPilot .bin. "
          "Such a file alone, without NAME=, stands for all devices in it")
      ->required();
  command->add_option("--out,-o", options->out, "the capture to write")->required()->type_name("FILE.lcm");
  command->add_option("--config", options->config, "configuration (default: drafted from the files)")
      ->type_name("FILE.toml");
  on_chosen(*command, chosen, [options] { return import_files(*options); });
}

}  // namespace imuscope::cli
