#include <memory>
#include <string>
#include <vector>

#include "commands.h"
#include "inputs.h"
#include "progress.h"
#include "service/recording/replay_run.h"
#include "study_table.h"

namespace imuscope::cli {

namespace {

struct ReplayCommand {
  std::vector<std::string> inputs;
  std::string config;
  std::string out;
  bool realtime = false;
  std::string lcm;
  bool json = false;
};

Result<void> replay(const ReplayCommand& options) {
  const auto opened = open_inputs(options.inputs, options.config);
  if (!opened) return tl::unexpected<Error>(opened.error());
  {
    ProgressBar bar;
    const ReplayRunOptions run{options.out, IMUSCOPE_VERSION,
                               [&](double share) { bar.show("replay", share); }, options.realtime,
                               options.lcm};
    if (auto done = run_replay(opened->configuration, opened->recording, run); !done) return done;
  }
  return print_study(options.out, options.json);
}

}  // namespace

void add_replay(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("replay", "The live pipeline again, fed from a recording");
  auto options = std::make_shared<ReplayCommand>();
  add_inputs(*command, options->inputs, options->config);
  command->add_option("--out,-o", options->out, "folder for the results")->required()->type_name("DIR");
  command->add_flag("--realtime", options->realtime, "paced as recorded");
  command->add_option("--lcm", options->lcm, "publish here what the live run published, for top and lcm-spy")
      ->type_name("URL");
  command->add_flag("--json", options->json, "print the summary as JSON");
  on_chosen(*command, chosen, [options] { return replay(*options); });
}

}  // namespace imuscope::cli
