#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "commands.h"
#include "print.h"
#include "service/doctor/examination.h"

namespace imuscope::cli {

namespace {

using doctor::Verdict;

constexpr std::array kVerdicts{"good", "warning", "BAD"};

struct DoctorCommand {
  std::string config;
  std::string root = "/";
  bool json = false;
};

const char* word_of(Verdict verdict) { return kVerdicts[static_cast<std::size_t>(verdict)]; }

void print_table(const std::vector<doctor::Finding>& findings) {
  for (const auto& finding : findings) {
    say("{:<8} {:<16} {}\n", word_of(finding.verdict), finding.check, finding.what);
    if (!finding.fix.empty()) say("{:<8} {:<16}   fix: {}\n", "", "", finding.fix);
  }
}

void print_json(const std::vector<doctor::Finding>& findings) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& finding : findings) {
    list.push_back({{"check", finding.check},
                    {"verdict", finding.verdict == Verdict::kBad ? "bad" : word_of(finding.verdict)},
                    {"what", finding.what},
                    {"fix", finding.fix}});
  }
  say("{}\n", json_text(list));
}

Result<void> run(const DoctorCommand& options) {
  doctor::Examination examination;
  examination.root = options.root;
  if (!options.config.empty()) {
    auto configuration = load_configuration(options.config);
    if (!configuration) return tl::unexpected<Error>(configuration.error());
    examination.configuration = std::move(*configuration);
  }
  const auto findings = doctor::examine(examination);
  options.json ? print_json(findings) : print_table(findings);
  const auto bad = std::count_if(findings.begin(), findings.end(),
                                 [](const auto& finding) { return finding.verdict == Verdict::kBad; });
  if (bad == 0) return {};
  return work_error(fmt::format("{} of {} checks are bad", bad, findings.size()), "apply the fixes above");
}

}  // namespace

void add_doctor(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "doctor", "What on this PC stands between the service and its deadlines; each finding with its fix");
  auto options = std::make_shared<DoctorCommand>();
  command->add_option("config", options->config, "configuration whose lines, disk and bus are looked at, too")
      ->type_name("CONFIG");
  command
      ->add_option("--root", options->root, "folder that holds proc and sys, to look at a PC's copy of them")
      ->capture_default_str()
      ->type_name("DIR");
  command->add_flag("--json", options->json, "print the findings as JSON");
  on_chosen(*command, chosen, [options] { return run(*options); });
}

}  // namespace imuscope::cli
