#include "results/report/picture.h"

#include <spawn.h>
#include <sys/wait.h>
#include <utility>

extern char** environ;

namespace imuscope::report {
namespace {

/// Draws the panels once for each format. Run in its own folder, so that no path stands in it.
GnuplotScript script_of(const Picture& picture) {
  constexpr double kPanelWidth_in = 3.0;
  constexpr double kPanelHeight_in = 2.2;
  constexpr double kPixelsPerInch = 96.0;
  const double width = picture.columns == 1 ? 2.0 * kPanelWidth_in : kPanelWidth_in * picture.columns;
  const double height =
      picture.columns == 1 ? 2.0 * kPanelHeight_in * picture.rows : kPanelHeight_in * picture.rows;
  auto script = GnuplotScript::of("# imuscope: gnuplot draws this file as SVG and PDF.\nset encoding utf8\n");
  const std::pair<GnuplotScript, std::string> kOutputs[] = {
      {GnuplotScript::of("svg size {:.0f},{:.0f} dynamic background 'white' font 'sans,11'",
                         width * kPixelsPerInch, height * kPixelsPerInch),
       ".svg"},
      {GnuplotScript::of("pdfcairo size {:g}in,{:g}in font 'sans,8'", width, height), ".pdf"}};
  for (const auto& [terminal, suffix] : kOutputs) {
    script.add(
        "reset\nset terminal {}\nset output {}\nset grid linecolor rgb '#dddddd'\n"
        "set border 3\nset tics nomirror\nset multiplot layout {},{}\n{}unset multiplot\n"
        "set output\n",
        terminal, GnuplotText(picture.name + suffix), picture.rows, picture.columns, picture.body);
  }
  return script;
}

/// Runs gnuplot on a script in `folder`.
Result<void> draw(const OutputFolder& folder, const std::string& script, const std::string& shown) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addfchdir_np(&actions, folder.descriptor());
  std::string program = "gnuplot";
  std::string file = script;
  // Its own settings alone: what lies in a folder from elsewhere is no start-up file.
  std::string defaults = "-d";
  char* arguments[] = {program.data(), defaults.data(), file.data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    return work_error("gnuplot could not be started",
                      "install it (apt-get install gnuplot-nox), or draw " + shown + " elsewhere");
  }
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return work_error("gnuplot refused " + shown, "its own message is above");
  return {};
}

}  // namespace

Result<void> draw_into(const OutputFolder& figures, const Picture& picture) {
  const std::string script = picture.name + ".gp";
  const auto scratch = figures.scratch_folder();
  if (!scratch) return tl::unexpected<Error>(scratch.error());
  Result<void> done = scratch->write_whole(script, script_of(picture).str());
  if (done) done = draw(*scratch, script, (figures.path() / script).string());
  for (const char* suffix : {".gp", ".svg", ".pdf"}) {
    const std::string name = picture.name + suffix;
    auto taken = figures.take(*scratch, name);
    if (done && !taken) done = std::move(taken);
    scratch->remove(name);
  }
  figures.remove(scratch->path().filename().string());
  return done;
}

}  // namespace imuscope::report
