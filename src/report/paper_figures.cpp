#include "report/paper_figures.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>

#include "base/units.h"
#include "report/figures.h"
#include "report/fits.h"
#include "report/run_files.h"

extern char** environ;

namespace imuscope {
namespace report {
namespace {

/// Told apart by the colour-blind (Okabe and Ito).
constexpr const char* kColours[] = {"#d1600a", "#0b9a6e", "#3a86d8"};

/// A script under construction: panels of one picture.
struct Picture {
  std::string name;
  int rows = 1;
  int columns = 1;
  std::string body;
};

std::string cell(double value) { return std::isfinite(value) ? fmt::format("{:.9g}", value) : "NaN"; }

/// Text inside single quotes of gnuplot.
std::string gnuplot_text(std::string any) {
  for (std::size_t at = 0; (at = any.find('\'', at)) != std::string::npos; at += 2) any.insert(at, 1, '\'');
  return "'" + any + "'";
}

/// Mean, smallest and largest of a signal over time; a blank line where there is a gap.
std::string block_of(const std::string& name, const BinnedSignals& signals, std::size_t signal) {
  std::string block = "$" + name + " << EOD\n";
  for (std::size_t i = 0; i < signals.size(); ++i) {
    const auto& bin = signals.bin(signal, i);
    block += bin.n == 0 ? std::string("\n")
                        : fmt::format("{} {} {} {}\n", cell(signals.time_s(i)), cell(bin.mean()),
                                      cell(bin.smallest), cell(bin.largest));
  }
  return block + "EOD\n";
}

/// Estimate and its sd over time.
std::string block_of(const std::string& name, const BinnedSignals& signals, std::size_t signal,
                     std::size_t sd_signal, double unit) {
  std::string block = "$" + name + " << EOD\n";
  for (std::size_t i = 0; i < signals.size(); ++i) {
    const double value = unit * signals.bin(signal, i).last;
    const double sd = unit * signals.bin(sd_signal, i).last;
    block += std::isfinite(value) ? fmt::format("{} {} {} {}\n", cell(signals.time_s(i)), cell(value),
                                                cell(value - sd), cell(value + sd))
                                  : std::string("\n");
  }
  return block + "EOD\n";
}

/// Band of columns 3 and 4 behind the line of column 2.
std::string band_plot(const std::string& block, const char* colour) {
  return fmt::format(
      "plot ${0} using 1:3:4 with filledcurves fillcolor rgb '{1}' fillstyle transparent solid 0.25 noborder "
      "notitle, ${0} using 1:2 with lines linecolor rgb '{1}' linewidth 1 notitle\n",
      block, colour);
}

Picture drive_picture(const RunFiles& run) {
  const BinnedSignals& navigation = *run.navigation;
  Picture picture{"drive", 2, 1, "$way << EOD\n"};
  for (std::size_t i = 0; i < navigation.size(); ++i) {
    const double north = navigation.bin(kNorth_m, i).last;
    picture.body += std::isfinite(north) ? fmt::format("{} {} {}\n", cell(navigation.bin(kEast_m, i).last),
                                                       cell(north), cell(navigation.bin(kSpeed_mps, i).last))
                                         : std::string("\n");
  }
  picture.body += "EOD\n" + block_of("speed", navigation, kSpeed_mps);
  picture.body +=
      "set size ratio -1\nset xlabel 'east, m'\nset ylabel 'north, m'\nset cblabel 'speed, m/s'\n"
      "plot $way using 1:2:3 with lines linecolor palette linewidth 2 notitle\nset size noratio\n"
      "set autoscale xfix\nset xlabel 'time, s'\nset ylabel 'speed, m/s'\n";
  picture.body += band_plot("speed", kColours[2]);
  return picture;
}

/// The paper's Figure 1: three angles, three lengths.
Picture estimate_picture(const StudyFiles& study) {
  Picture picture{"figure1_" + study.name, 2, 3, {}};
  constexpr const char* kAxisNames[] = {"x", "y", "z"};
  picture.body += "set autoscale xfix\nset xlabel 'time, s'\n";
  for (std::size_t i = 0; i < 2 * kTriad; ++i) {
    const bool angle = i < kTriad;
    const std::string block = fmt::format("estimate{}", i);
    const std::size_t signal = angle ? kPsi_deg + i : kLeverArm_m + i - kTriad;
    const double unit = angle ? 1.0 : kMmPerM;
    picture.body += block_of(block, *study.calibration_series, signal, signal + kSdOffset, unit);
    const auto window = settled_window(*study.calibration_series, signal, signal + kSdOffset, unit, {});
    picture.body += window ? fmt::format("set yrange [{}:{}]\n", cell(window->begin_s), cell(window->end_s))
                           : std::string("set yrange [*:*]\n");
    picture.body += fmt::format("set ylabel '{} {}, {}'\n", angle ? "{/Symbol y}" : "r",
                                kAxisNames[i % kTriad], angle ? "deg" : "mm");
    picture.body += band_plot(block, kColours[i % kTriad]);
  }
  return picture;
}

Picture error_picture(const StudyFiles& study) {
  Picture picture{"figure2_" + study.name, 2, 3, "set autoscale xfix\nset xlabel 'time, s'\n"};
  for (std::size_t i = 0; i < kErrorSignals; ++i) {
    const std::string block = fmt::format("error{}", i);
    picture.body += block_of(block, *study.errors, i);
    picture.body += fmt::format("set ylabel '{}, {}'\n", axis_words(kAxes[i]), i < kTriad ? "deg/s" : "m/s²");
    picture.body += band_plot(block, kColours[i % kTriad]);
  }
  return picture;
}

/// The paper's Figure 3: errors of gyroscope x and accelerometer z against their own axes' motion.
Picture scatter_picture(const StudyFiles& study) {
  struct Panel {
    std::size_t error;
    std::size_t covariate;
    const char* words;
  };
  constexpr Panel kPanels[] = {{0, 0, "angular rate x, rad/s"},
                               {0, 3, "angular acceleration x, rad/s²"},
                               {0, 6, "angular jerk x, rad/s³"},
                               {5, 11, "specific force z, m/s²"},
                               {5, 14, "linear jerk z, m/s³"}};
  Picture picture{"figure3_" + study.name, 2, 3, {}};
  int n = 0;
  for (const Panel& panel : kPanels) {
    picture.body += fmt::format("$points{} << EOD\n", n);
    const auto& x = study.scatter->covariates[panel.covariate];
    const auto& y = study.scatter->errors[panel.error];
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (std::isfinite(x[i]) && std::isfinite(y[i]))
        picture.body += fmt::format("{:.5g} {:.5g}\n", x[i], y[i]);
    }
    picture.body += fmt::format(
        "EOD\nset xlabel '{}'\nset ylabel 'error of {}, {}'\nplot $points{} using 1:2 with points pointtype "
        "7 "
        "pointsize 0.15 linecolor rgb '{}' notitle\n",
        panel.words, axis_words(kAxes[panel.error]), panel.error < kTriad ? "deg/s" : "m/s²", n,
        kColours[panel.error % kTriad]);
    ++n;
  }
  return picture;
}

/// Observed, interval, total and every component of one fit.
std::string wavelet_block(const std::string& name, const Fit& fit) {
  std::string block = "$" + name + " << EOD\n";
  for (std::size_t i = 0; i < fit.levels.size(); ++i) {
    const FitLevel& level = fit.levels[i];
    block += fmt::format("{} {} {} {} {}", cell(level.tau_s), cell(or_nan(level.value)),
                         cell(or_nan(level.ci_low)), cell(or_nan(level.ci_high)), cell(or_nan(level.fitted)));
    for (const FitComponent& component : fit.components) {
      if (component.values.size() == fit.levels.size()) block += " " + cell(component.values[i]);
    }
    block += "\n";
  }
  return block + "EOD\n";
}

std::string wavelet_plots(const std::string& block, const Fit& fit, const char* colour) {
  constexpr int kFirstComponent = 6;
  std::string plots = fmt::format(
      "${0} using 1:2:3:4 with yerrorbars pointtype 7 pointsize 0.4 linecolor rgb '{1}' title {2}, "
      "${0} using 1:5 with lines linewidth 1.5 linecolor rgb '{1}' notitle",
      block, colour, gnuplot_text(fit.regime.empty() ? "all" : fit.regime));
  for (std::size_t i = 0; i < fit.components.size(); ++i) {
    if (fit.components[i].values.size() != fit.levels.size()) continue;
    plots += fmt::format(", ${} using 1:{} with lines dashtype 2 linewidth 0.8 linecolor rgb '{}' notitle",
                         block, kFirstComponent + static_cast<int>(i), colour);
  }
  return plots;
}

/// Between half the smallest and twice the largest of what was observed and fitted: a component may leave it.
std::string wavelet_range(const std::vector<const Fit*>& fits) {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  for (const Fit* fit : fits) {
    for (const FitLevel& level : fit->levels) {
      for (const auto& value : {level.value, level.fitted}) {
        if (!value || !(*value > 0.0)) continue;
        low = std::min(low, *value);
        high = std::max(high, *value);
      }
    }
  }
  return high > 0.0 ? fmt::format("set yrange [{}:{}]\n", cell(0.5 * low), cell(2.0 * high))
                    : std::string("set yrange [*:*]\n");
}

std::optional<Picture> wavelet_picture(const std::vector<Fit>& fits, const std::string& imu) {
  Picture picture{"figure4_" + imu, 2, 3,
                  "set logscale xy\nset format '10^{%L}'\nset key top right samplen 1\nset xlabel 'scale τ, "
                  "s'\n"};
  bool any = false;
  for (const char* axis : kAxes) {
    std::vector<const Fit*> of_axis;
    for (const Fit& fit : fits) {
      const bool part = fit.regime != "all" && !fit.regime.empty();
      if (fit.imu == imu && fit.axis == axis && part && !fit.levels.empty()) of_axis.push_back(&fit);
    }
    if (of_axis.empty()) {
      const Fit* whole = find_fit(fits, imu, axis, "all");
      if (whole == nullptr || whole->levels.empty()) {
        picture.body += "set multiplot next\n";
        continue;
      }
      of_axis.push_back(whole);
    }
    any = true;
    std::string plots;
    for (std::size_t i = 0; i < of_axis.size(); ++i) {
      const std::string block = fmt::format("{}_{}", axis, i);
      picture.body += wavelet_block(block, *of_axis[i]);
      plots += (plots.empty() ? "" : ", ") + wavelet_plots(block, *of_axis[i], kColours[(i + 2) % kTriad]);
    }
    picture.body +=
        wavelet_range(of_axis) +
        fmt::format("set ylabel {}\nplot {}\n",
                    gnuplot_text(fmt::format("{}, ({})²", axis_words(axis), of_axis.front()->unit)), plots);
  }
  return any ? std::optional(picture) : std::nullopt;
}

std::vector<Picture> pictures_of(const RunFiles& run) {
  std::vector<Picture> pictures;
  if (run.navigation) pictures.push_back(drive_picture(run));
  const auto fits = read_fits(run.models);
  for (const StudyFiles& study : run.studies) {
    if (study.calibration_series) pictures.push_back(estimate_picture(study));
    if (study.errors) pictures.push_back(error_picture(study));
    if (study.scatter) pictures.push_back(scatter_picture(study));
    if (auto wavelet = wavelet_picture(fits, study.name)) pictures.push_back(std::move(*wavelet));
  }
  return pictures;
}

/// Draws the panels once for each format. Run in its own folder, so that no path has to be gnuplot_text.
std::string script_of(const Picture& picture) {
  constexpr double kPanelWidth_in = 3.0;
  constexpr double kPanelHeight_in = 2.2;
  constexpr double kPixelsPerInch = 96.0;
  const double width = picture.columns == 1 ? 2.0 * kPanelWidth_in : kPanelWidth_in * picture.columns;
  const double height =
      picture.columns == 1 ? 2.0 * kPanelHeight_in * picture.rows : kPanelHeight_in * picture.rows;
  std::string script = "# imuscope: gnuplot draws this file as SVG and PDF.\nset encoding utf8\n";
  const std::pair<std::string, const char*> kOutputs[] = {
      {fmt::format("svg size {:.0f},{:.0f} dynamic background 'white' font 'sans,11'", width * kPixelsPerInch,
                   height * kPixelsPerInch),
       "svg"},
      {fmt::format("pdfcairo size {:g}in,{:g}in font 'sans,8'", width, height), "pdf"}};
  for (const auto& [terminal, suffix] : kOutputs) {
    script += fmt::format(
        "reset\nset terminal {}\nset output '{}.{}'\nset grid linecolor rgb '#dddddd'\n"
        "set border 3\nset tics nomirror\nset multiplot layout {},{}\n{}unset multiplot\n"
        "set output\n",
        terminal, picture.name, suffix, picture.rows, picture.columns, picture.body);
  }
  return script;
}

/// Runs gnuplot on a script in `folder`.
Result<void> draw(const std::filesystem::path& folder, const std::string& script) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  std::string program = "gnuplot";
  std::string file = script;
  char* arguments[] = {program.data(), file.data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    return work_error("gnuplot could not be started", "install it (apt-get install gnuplot-nox), or draw " +
                                                          (folder / script).string() + " elsewhere");
  }
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return work_error("gnuplot refused " + (folder / script).string(), "its own message is above");
  return {};
}

}  // namespace
}  // namespace report

Result<std::vector<std::filesystem::path>> write_figures(const std::filesystem::path& run_dir) {
  const auto run = report::read_run_files(run_dir);
  if (!run) return tl::unexpected<Error>(run.error());
  const auto folder = run_dir / "figures";
  std::error_code code;
  std::filesystem::create_directories(folder, code);
  std::vector<std::filesystem::path> files;
  for (const report::Picture& picture : report::pictures_of(*run)) {
    const std::string script = picture.name + ".gp";
    std::ofstream out(folder / script);
    out << report::script_of(picture);
    out.close();
    if (!out) {
      return work_error((folder / script).string() + " could not be written",
                        "check the folder's permissions and the disk's free space");
    }
    if (auto drawn = report::draw(folder, script); !drawn) return tl::unexpected<Error>(drawn.error());
    for (const char* suffix : {".svg", ".pdf"}) files.push_back(folder / (picture.name + suffix));
  }
  return files;
}

}  // namespace imuscope
