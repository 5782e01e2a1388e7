#include <fmt/format.h>
#include <memory>

#include "base/json_text.h"
#include "combination_table.h"
#include "commands.h"
#include "print.h"
#include "study/combination.h"

namespace imuscope::cli {
namespace {

struct CombineCommand {
  std::vector<std::string> runs;
  bool correlated = false;
  bool independent = false;
  bool json = false;
};

Result<void> combine_runs(const CombineCommand& options) {
  std::vector<DriveMountings> drives;
  for (const auto& run : options.runs) {
    auto drive = read_mountings(run);
    if (!drive) return tl::unexpected<Error>(drive.error());
    drives.push_back(std::move(*drive));
  }
  std::optional<CombineMethod> method;
  if (options.correlated) method = CombineMethod::kCovarianceIntersection;
  if (options.independent) method = CombineMethod::kInverseVariance;
  const auto combined = combine_drives(drives, method);
  if (!combined) return tl::unexpected<Error>(combined.error());
  if (options.json) {
    say("{}\n", json_text(combination_json(*combined)));
  } else {
    print_combination(*combined);
  }
  return {};
}

}  // namespace

void add_combine(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "combine", "One mounting from several drives, with the test whether it is one mounting");
  auto options = std::make_shared<CombineCommand>();
  command->add_option("RUN_DIR", options->runs, "folders of finished runs, one a drive")
      ->required()
      ->expected(2, -1)
      ->type_name("DIR");
  auto* correlated = command->add_flag(
      "--correlated", options->correlated,
      "the drives may share errors (one recording cut in two, one turn-on): covariance intersection");
  command
      ->add_flag("--independent", options->independent,
                 "the drives' errors are independent: inverse variance (the default, "
                 "unless they read the same files)")
      ->excludes(correlated);
  command->add_flag("--json", options->json, "print JSON");
  on_chosen(*command, chosen, [options] { return combine_runs(*options); });
}

}  // namespace imuscope::cli
