#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>
#include <set>
#include <vector>

#include "commands.h"
#include "export_hdf5.h"
#include "export_run.h"
#include "fit_file.h"
#include "models/noise/export.h"
#include "print.h"

namespace imuscope::cli {
namespace {

struct ExportCommand {
  std::vector<std::filesystem::path> files;
  std::string format;
  std::string name;
  std::string regime;
  std::string unit;
  noise::ExportOptions how;
  ExportRun of_run;
};

/// Keeps the fits whose `member` is `wanted`; without a wish there must be one choice only.
Result<void> keep(std::vector<StoredFit>& fits, std::string StoredFit::*member, const std::string& wanted,
                  const char* option) {
  std::set<std::string> choices;
  for (const StoredFit& fit : fits) choices.insert(fit.*member);
  if (wanted.empty()) {
    if (choices.size() <= 1) return {};
    return usage_error(fmt::format("there is a choice of {}", fmt::join(choices, ", ")),
                       fmt::format("give {}", option));
  }
  if (!choices.contains(wanted)) {
    return usage_error(fmt::format("{} {} is not there", option, wanted),
                       fmt::format("there is {}", fmt::join(choices, ", ")));
  }
  std::erase_if(fits, [&](const StoredFit& fit) { return fit.*member != wanted; });
  return {};
}

Result<void> export_models(const ExportCommand& options) {
  const auto format = noise::parse_export_format(options.format);
  if (!format) return tl::unexpected(format.error());
  const auto unit = noise::parse_unit(options.unit);
  if (!unit) return tl::unexpected(unit.error());
  std::vector<StoredFit> fits;
  for (const auto& file : options.files) {
    auto read = read_fits(file);
    if (!read) return tl::unexpected(read.error());
    fits.insert(fits.end(), read->begin(), read->end());
  }
  if (auto kept = keep(fits, &StoredFit::name, options.name, "--name"); !kept) return kept;
  if (auto kept = keep(fits, &StoredFit::regime, options.regime, "--regime"); !kept) return kept;
  std::vector<noise::AxisFit> axes;
  for (StoredFit& fit : fits) {
    axes.push_back({fit.axis, options.unit.empty() ? fit.unit : *unit, std::move(fit.fit), fit.source});
  }
  const auto text = noise::export_models(axes, *format, options.how);
  if (!text) return tl::unexpected(text.error());
  say("{}", *text);
  return {};
}

/// A whole run in one file.
Result<void> export_run(ExportCommand& options) {
  if (options.files.size() != 1) return usage_error("more than one run is given", "export them one by one");
  if (options.format == "hdf5")
    return export_hdf5(options.files.front(), options.of_run.out, options.how.force);
  options.of_run.run = options.files.front();
  return export_mcap(options.of_run);
}

Result<void> run_export(ExportCommand& options) {
  if (options.format == "mcap" || options.format == "hdf5") return export_run(options);
  if (!options.of_run.out.empty())
    return usage_error("--out is of a whole run", "redirect what is printed: > FILE");
  const bool is_of_run = options.files.size() == 1 && has_mountings(options.files.front());
  if (is_of_run) return export_mounting(options.files.front(), options.name, options.format);
  return export_models(options);
}

}  // namespace

void add_export(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "export",
      "A run as a bag or one HDF5 file, noise models and mountings as another tool's configuration");
  auto options = std::make_shared<ExportCommand>();
  command
      ->add_option("MODEL", options->files,
                   "A run's folder; what `imuscope fit --json` printed (one file an axis), a run's "
                   "models.json, or the certificate.json of `imuscope characterize`")
      ->required();
  command
      ->add_option(
          "--to,-t", options->format,
          "Of a run: mcap or hdf5, all of it in one file; urdf, tf, kalibr, openvins or json, a mounting. "
          "Of noise models: kalibr, openvins, vins-fusion, lio-sam, gtsam, ros, px4, kf-gins or state-space")
      ->required();
  command->add_option("--name,-n", options->name, "The S-IMU to export, where the file holds several");
  command->add_option("--regime", options->regime, "all, static or dynamic, where the file holds several");
  command->add_option("--unit,-u", options->unit,
                      "Unit of the signal, where the file does not say: rad/s, deg/s, m/s^2 or g");
  command->add_flag("--conservative", options->how.conservative,
                    "Upper ends of the intervals, for a filter that must not be optimistic");
  command->add_flag("--force", options->how.force,
                    "Write even what does not hold: the file then says why it should not be used; of hdf5: "
                    "write over a file that is there");
  command->add_option("--out,-o", options->of_run.out,
                      "mcap, hdf5: the file; without it run.mcap or run.h5 in the run's folder");
  options->of_run.compression = "zstd";
  command->add_option("--compression", options->of_run.compression, "mcap: zstd, lz4 or none")
      ->capture_default_str();
  command->add_flag("--errors", options->of_run.with_errors, "mcap: the rows of the error process, too");
  command->add_option(
      "--recording", options->of_run.inputs,
      "mcap: the capture or the raw dumps (NAME=FILE), where they are no longer where they were");
  command->add_option("--config", options->of_run.config, "mcap: the configuration of that recording");
  on_chosen(*command, chosen, [options] { return run_export(*options); });
}

}  // namespace imuscope::cli
