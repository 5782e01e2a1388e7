/// What looks after recordings, devices and a running service, in every package.

#include "commands.h"

namespace imuscope::cli {

void add_care_commands(CLI::App& app, Work& work) {
  add_capture(app, work);
  add_probe(app, work);
  add_top(app, work);
  add_status(app, work);
  add_keep(app, work);
  add_doctor(app, work);
  add_config(app, work);
  add_completion(app, work);
  add_help(app, work);
}

}  // namespace imuscope::cli
