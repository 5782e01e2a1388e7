#include "findings.h"

#include <fmt/format.h>
#include <algorithm>

#include "base/output_folder.h"
#include "base/text.h"
#include "check/config_lines.h"
#include "print.h"
#include "progress.h"
#include "results/tables/json_file.h"
#include "service/recording/recorded_look.h"
#include "service/run/run_folder.h"
#include "service/run/run_record.h"

namespace imuscope::cli {

namespace {

const char* words_of(check::Harm harm) {
  switch (harm) {
    case check::Harm::kWrong:
      return "WRONG  ";
    case check::Harm::kLimits:
      return "LIMITS ";
    case check::Harm::kNote:
      break;
  }
  return "NOTE   ";
}

std::ptrdiff_t count(const std::vector<check::Finding>& findings, check::Harm harm) {
  return std::count_if(findings.begin(), findings.end(),
                       [harm](const check::Finding& finding) { return finding.harm == harm; });
}

/// As the user wrote it; of a capture, as it was kept.
std::string text_of(const Configuration& configuration) {
  std::error_code error;
  if (std::filesystem::is_regular_file(configuration.file, error)) {
    if (auto text = read_text_file(configuration.file.string(), "configuration", ""); text) return *text;
  }
  return configuration.text;
}

}  // namespace

void print_findings(const std::vector<check::Finding>& findings) {
  for (const check::Finding& finding : findings)
    say("{}{}\n", words_of(finding.harm), check::sentence(finding));
}

std::string harm_in_short(const std::vector<check::Finding>& findings) {
  const auto wrong = count(findings, check::Harm::kWrong);
  const auto limits = count(findings, check::Harm::kLimits);
  if (wrong > 0) {
    return fmt::format("Do not use these results: {} of the data or the configuration {} wrong, above all {}",
                       wrong == 1 ? "something" : fmt::format("{} things", wrong), wrong == 1 ? "is" : "are",
                       check::sentence(findings.front()));
  }
  if (limits > 0) return fmt::format("The data limit these results: {}", check::sentence(findings.front()));
  return {};
}

std::vector<check::Finding> look_at_capture(const std::filesystem::path& capture) {
  ProgressBar bar;
  const auto opened = open_recording(
      {capture.string()}, {}, [&bar](const std::string& what, double share) { bar.show(what, share); });
  if (!opened) return {};
  // A mistake is there from the beginning; a command of little memory keeps to that.
  constexpr double kLongest_s = 900.0;
  const std::vector<bool> run_time(opened->configuration.devices.size());
  return look_at_recording(opened->configuration, opened->recording, run_time, kLongest_s);
}

void print_look(const std::vector<check::Finding>& findings) {
  print_findings(findings);
  if (count(findings, check::Harm::kWrong) > 0)
    say("Correct these before you study it: `imuscope process` takes --fix FILE.toml and --config FILE.toml\n");
}

Result<void> look_at_live_run(const std::filesystem::path& run_dir) {
  nlohmann::json run = tables::read_json_file(run_dir / "run.json");
  const auto capture = run_dir / "capture.lcm";
  if (!run.is_object() || run.value("inputs", nlohmann::json{}) != nlohmann::json{"live"} ||
      !run.value("findings", nlohmann::json{}).is_null() || !std::filesystem::is_regular_file(capture))
    return {};
  const auto findings = look_at_capture(capture);
  run["findings"] = findings_json(findings);
  const auto folder = OutputFolder::open(run_dir);
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (auto written = write_json(*folder, "run.json", run); !written) return written;
  print_look(findings);
  return {};
}

Error explained(Error error, const std::vector<check::Finding>& findings) {
  if (findings.empty() || findings.front().harm != check::Harm::kWrong) return error;
  error.what = fmt::format("{}, which the data explain: {}", error.what,
                           findings.front().device + ": " + findings.front().what);
  error.remedy = findings.front().remedy;
  return error;
}

Result<void> write_fixed(const Configuration& configuration, const std::vector<check::Finding>& findings,
                         const std::filesystem::path& out) {
  const auto lines = check::lines_of(findings);
  if (lines.empty()) {
    return work_error(
        fmt::format("{} is not written: no line of the configuration is found to be wrong", out.string()),
        findings.empty() ? "" : "what was found is in the data themselves");
  }
  const auto text = check::with_lines(text_of(configuration), lines);
  if (!text) return tl::unexpected<Error>(text.error());
  if (auto good = parse_configuration(*text, out); !good) return tl::unexpected<Error>(good.error());
  std::error_code error;
  if (std::filesystem::exists(out, error))
    return usage_error(fmt::format("{} exists", out.string()), "give the name of a new file");
  const auto folder = OutputFolder::open(out.has_parent_path() ? out.parent_path() : ".");
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (auto written = folder->write_whole(out.filename().string(), *text); !written) return written;
  say("Corrected configuration: {} ({} {})\n", out.string(), lines.size(),
      lines.size() == 1 ? "line" : "lines");
  return {};
}

}  // namespace imuscope::cli
