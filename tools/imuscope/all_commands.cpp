/// The commands of the package imuscope: all there are.

#include "commands.h"
#include "results/report/report.h"

namespace imuscope::cli {

void add_commands(CLI::App& app, Work& work) {
  add_wv(app, work);
  add_fit(app, work);
  add_characterize(app, work);
  add_correlate(app, work);
  add_compare(app, work);
  add_export(app, work);
  add_run(app, work, [](const std::filesystem::path& folder) { return write_report(folder); });
  add_replay(app, work);
  add_process(app, work);
  add_combine(app, work);
  add_evaluate(app, work);
  add_report(app, work);
  add_tables(app, work);
  add_fleet(app, work);
  add_decode(app, work);
  add_import(app, work);
  add_view(app, work);
  add_care_commands(app, work);
}

std::vector<std::string> commands_of_another_package() { return {}; }

}  // namespace imuscope::cli
