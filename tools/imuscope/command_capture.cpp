#include <fmt/format.h>
#include <algorithm>
#include <memory>
#include <string>

#include "base/text.h"
#include "capture/capture_repair.h"
#include "commands.h"
#include "print.h"
#include "progress.h"
#include "service/recording/capture_damage.h"

namespace imuscope::cli {
namespace {

struct CaptureCommand {
  std::string file;
  std::string out;
};

Result<CaptureCheck> look_through(const std::string& file) {
  ProgressBar bar;
  return check_capture(file, [&bar](double share) { bar.show("looking through", share); });
}

std::string_view words_of(IndexVerdict verdict) {
  switch (verdict) {
    case IndexVerdict::kAgrees:
      return "as it was recorded";
    case IndexVerdict::kDisagrees:
      return "differs from what was recorded";
    case IndexVerdict::kNone:
      break;
  }
  return "without an index";
}

void say_check(const CaptureCheck& check, const std::string& file) {
  for (const FileCheck& one : check.files) {
    say("{:<24} {:>12} bytes  {}\n", capture_file(file, one.file.number).filename().string(), one.bytes,
        one.file.health.is_sealed ? words_of(one.index) : "of a version without checksums");
  }
  for (const auto& [name, device] : check.summary.devices) {
    say("{:<24} {:>12} reads, {} writes, {:.1f} s\n", one_line(name), device.reads, device.writes,
        to_seconds(device.last - device.first));
  }
  for (const auto& sentence : damage_of(check.summary, file)) say("{}\n", sentence);
}

/// Whether there is something to be left out of a copy. Nothing is wrong with a capture of a version without
/// checksums in which nothing is damaged.
bool are_files_damaged(const CaptureCheck& check, const std::string& file) {
  CaptureSummary files_alone;
  files_alone.files = check.summary.files;
  for (const CaptureBreak& gap : check.summary.breaks) {
    // A file that is not there is in no copy either.
    if (gap.beginning_is_damaged) files_alone.breaks.push_back(gap);
  }
  return !damage_of(files_alone, file).empty() ||
         std::any_of(check.files.begin(), check.files.end(),
                     [](const FileCheck& one) { return one.index == IndexVerdict::kDisagrees; });
}

Result<void> check(const CaptureCommand& options) {
  const auto checked = look_through(options.file);
  if (!checked) return tl::unexpected<Error>(checked.error());
  say_check(*checked, options.file);
  if (are_files_damaged(*checked, options.file))
    return work_error(
        options.file + " is not whole (above)",
        "replay and process use what is; imuscope capture repair copies that into a new capture");
  // What never came into it, or what a repair had to leave out, no repair brings back.
  if (!damage_of(checked->summary, options.file).empty())
    return work_error(options.file + " lacks records (above), and what it has is whole",
                      "replay and process use it as it is");
  return {};
}

Result<void> repair(const CaptureCommand& options) {
  const auto checked = look_through(options.file);
  if (!checked) return tl::unexpected<Error>(checked.error());
  say_check(*checked, options.file);
  std::filesystem::path out = options.out;
  if (out.empty()) {
    const std::filesystem::path file = options.file;
    out = file.parent_path() / (file.stem().string() + "_repaired" + file.extension().string());
  }
  const auto repaired = repair_capture(options.file, *checked, out);
  if (!repaired) return tl::unexpected<Error>(repaired.error());
  say("wrote {} records into {} file{}, the first of them {}\n", repaired->records, repaired->files.size(),
      repaired->files.size() == 1 ? "" : "s", out.string());
  return {};
}

}  // namespace

void add_capture(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("capture", "Checks and repairs captures");
  command->require_subcommand(1);
  auto options = std::make_shared<CaptureCommand>();
  const auto add = [&](const char* name, const char* what, Result<void> (*work)(const CaptureCommand&)) {
    auto* one = command->add_subcommand(name, what);
    one->add_option("FILE.lcm", options->file, "the capture; of several files the first")->required();
    on_chosen(*one, chosen, [options, work] { return work(*options); });
    return one;
  };
  add("check", "Holds every record against its checksum; fails where something is damaged or missing", check);
  add("repair", "Copies all that is whole into a new capture", repair)
      ->add_option("--out,-o", options->out, "the new capture (default: FILE_repaired.lcm)")
      ->type_name("FILE.lcm");
}

}  // namespace imuscope::cli
