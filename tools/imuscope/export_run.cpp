#include "export_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/text.h"
#include "logs/bag/mounting_text.h"
#include "print.h"
#include "progress.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"
#include "study/mountings.h"
#include "study/run_bag.h"

namespace imuscope::cli {

Result<void> export_mcap(const ExportRun& options) {
  RunBagOptions bag;
  bag.source = {options.run, options.inputs, options.config};
  bag.out = options.out.empty() ? options.run / "run.mcap" : std::filesystem::path(options.out);
  bag.version = IMUSCOPE_VERSION;
  const auto compression =
      options.compression == "none" ? mcap::Compression::kNone : mcap::compression_of(options.compression);
  if (!compression || (options.compression.empty()))
    return usage_error(fmt::format("--compression {} is not known", options.compression),
                       "give zstd, lz4 or none");
  bag.compression = *compression;
  bag.with_errors = options.with_errors;
  ProgressBar bar;
  bag.progress = [&bar](double share) { bar.show("export", share); };
  const auto written = write_run_bag(bag);
  bar.clear();
  if (!written) return tl::unexpected<Error>(written.error());
  for (const auto& remark : written->remarks) say("Note: {}\n", remark);
  if (!written->times_are_utc) say("Note: nobody told UTC in this run: times count from its first sample\n");
  constexpr double kBytesPerMb = 1e6;
  say("{}: {} messages, {:.1f} MB\n", bag.out.string(), written->messages,
      static_cast<double>(written->bytes) / kBytesPerMb);
  return {};
}

bool has_mountings(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) return true;
  if (!std::filesystem::is_regular_file(path)) return false;
  const auto document = tables::read_json_file(path);
  return tables::text_at(document, "schema").starts_with("imuscope.calibration/");
}

namespace {

/// The reference's name, of the run that the calibration belongs to.
std::string reference_of(const std::filesystem::path& folder) {
  const auto run = tables::read_json_file(folder / "run.json");
  for (const auto& device : tables::field(run, "devices")) {
    std::string name = tables::text_at(device, "name");
    if (tables::text_at(device, "role") == "reference" && is_device_name(name)) return name;
  }
  return "the reference IMU";
}

}  // namespace

Result<void> export_mounting(const std::filesystem::path& path, const std::string& name,
                             const std::string& format) {
  const auto how = bag::parse_mounting_format(format);
  if (!how) return tl::unexpected<Error>(how.error());
  const bool is_folder = std::filesystem::is_directory(path);
  const auto file = is_folder ? path / "calibration.json" : path;
  const auto document = tables::read_json_file(file);
  if (document.is_discarded())
    return work_error(fmt::format("{} cannot be read", file.string()),
                      "give the folder of a run or its calibration.json");
  const auto found = found_calibrations(document);
  std::vector<std::string> names;
  for (const auto& calibration : found) names.push_back(calibration.mounting.name);
  if (found.empty())
    return work_error(fmt::format("{}: no S-IMU has a mounting", file.string()), "drive longer, with turns");
  if (name.empty() && names.size() > 1)
    return usage_error(fmt::format("there is a choice of {}", fmt::join(names, ", ")), "give --name");
  const auto wanted = name.empty() ? names.begin() : std::find(names.begin(), names.end(), name);
  if (wanted == names.end())
    return usage_error(fmt::format("--name {} has no mounting", name),
                       fmt::format("there is {}", fmt::join(names, ", ")));
  const auto& chosen = found[static_cast<std::size_t>(wanted - names.begin())];
  say("{}", bag::mounting_text(chosen.mounting, chosen.correction, chosen.triads,
                               reference_of(is_folder ? path : path.parent_path()), *how));
  return {};
}

}  // namespace imuscope::cli
