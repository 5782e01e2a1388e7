#include "results/report/paper_figures.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "base/output_folder.h"
#include "base/text.h"
#include "base/units.h"
#include "results/report/figures.h"
#include "results/report/fits.h"
#include "results/report/picture.h"
#include "results/report/run_files.h"
#include "results/report/wavelet_plots.h"

namespace imuscope {
namespace report {
namespace {

/// Mean, smallest and largest of a signal over time; a blank line where there is a gap.
GnuplotScript block_of(const GnuplotScript& name, const BinnedSignals& signals, std::size_t signal) {
  auto block = GnuplotScript::of("${} << EOD\n", name);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    const auto& bin = signals.bin(signal, i);
    if (bin.n == 0) {
      block.add("\n");
    } else {
      block.add("{} {} {} {}\n", GnuplotNumber{signals.time_s(i)}, GnuplotNumber{bin.mean()},
                GnuplotNumber{bin.smallest}, GnuplotNumber{bin.largest});
    }
  }
  return block.add("EOD\n");
}

/// Estimate and its sd over time.
GnuplotScript block_of(const GnuplotScript& name, const BinnedSignals& signals, std::size_t signal,
                       std::size_t sd_signal, double unit) {
  auto block = GnuplotScript::of("${} << EOD\n", name);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    const double value = unit * signals.bin(signal, i).last;
    const double sd = unit * signals.bin(sd_signal, i).last;
    if (std::isfinite(value)) {
      block.add("{} {} {} {}\n", GnuplotNumber{signals.time_s(i)}, GnuplotNumber{value},
                GnuplotNumber{value - sd}, GnuplotNumber{value + sd});
    } else {
      block.add("\n");
    }
  }
  return block.add("EOD\n");
}

/// Band of columns 3 and 4 after the line of column 2.
GnuplotScript band_plot(const GnuplotScript& block, const GnuplotWord& colour) {
  return GnuplotScript::of(
      "plot ${0} using 1:3:4 with filledcurves fillcolor rgb '{1}' fillstyle transparent solid 0.25 noborder "
      "notitle, ${0} using 1:2 with lines linecolor rgb '{1}' linewidth 1 notitle\n",
      block, colour);
}

Picture drive_picture(const RunFiles& run) {
  const BinnedSignals& navigation = *run.navigation;
  Picture picture{"drive", 2, 1, GnuplotScript::of("$way << EOD\n")};
  for (std::size_t i = 0; i < navigation.size(); ++i) {
    const double north = navigation.bin(kNorth_m, i).last;
    if (std::isfinite(north)) {
      picture.body.add("{} {} {}\n", GnuplotNumber{navigation.bin(kEast_m, i).last}, GnuplotNumber{north},
                       GnuplotNumber{navigation.bin(kSpeed_mps, i).last});
    } else {
      picture.body.add("\n");
    }
  }
  const auto speed = GnuplotScript::of("speed");
  picture.body.add("EOD\n") += block_of(speed, navigation, kSpeed_mps);
  picture.body.add(
      "set size ratio -1\nset xlabel 'east, m'\nset ylabel 'north, m'\nset cblabel 'speed, m/s'\n"
      "plot $way using 1:2:3 with lines linecolor palette linewidth 2 notitle\nset size noratio\n"
      "set autoscale xfix\nset xlabel 'time, s'\nset ylabel 'speed, m/s'\n");
  picture.body += band_plot(speed, kPictureColours[2]);
  return picture;
}

/// The paper's Figure 1: three angles, three lengths.
Picture estimate_picture(const SImuFiles& study) {
  Picture picture{device_file_name("figure1", study.name, ""), 2, 3, {}};
  constexpr GnuplotWord kAxisNames[] = {"x", "y", "z"};
  constexpr GnuplotWord kAngle = "{/Symbol y}";
  constexpr GnuplotWord kLength = "r";
  picture.body.add("set autoscale xfix\nset xlabel 'time, s'\n");
  for (std::size_t i = 0; i < 2 * kTriad; ++i) {
    const bool angle = i < kTriad;
    const auto block = GnuplotScript::of("estimate{}", i);
    const std::size_t signal = angle ? kPsi_deg + i : kLeverArm_m + i - kTriad;
    const double unit = angle ? 1.0 : kMmPerM;
    picture.body += block_of(block, *study.calibration_series, signal, signal + kSdOffset, unit);
    if (const auto window = settled_window(*study.calibration_series, signal, signal + kSdOffset, unit, {})) {
      picture.body.add("set yrange [{}:{}]\n", GnuplotNumber{window->begin_s}, GnuplotNumber{window->end_s});
    } else {
      picture.body.add("set yrange [*:*]\n");
    }
    picture.body.add("set ylabel '{} {}, {}'\n", angle ? kAngle : kLength, kAxisNames[i % kTriad],
                     angle ? GnuplotWord("deg") : GnuplotWord("mm"));
    picture.body += band_plot(block, kPictureColours[i % kTriad]);
  }
  return picture;
}

Picture error_picture(const SImuFiles& study) {
  Picture picture{device_file_name("figure2", study.name, ""), 2, 3, {}};
  picture.body.add("set autoscale xfix\nset xlabel 'time, s'\n");
  for (std::size_t i = 0; i < kErrorSignals; ++i) {
    const auto block = GnuplotScript::of("error{}", i);
    picture.body += block_of(block, *study.errors, i);
    picture.body.add("set ylabel {}\n",
                     GnuplotText(fmt::format("{}, {}", axis_words(kAxes[i]), i < kTriad ? "deg/s" : "m/s²")));
    picture.body += band_plot(block, kPictureColours[i % kTriad]);
  }
  return picture;
}

/// The paper's Figure 3: errors of gyroscope x and accelerometer z against their own axes' motion.
Picture scatter_picture(const SImuFiles& study) {
  struct Panel {
    std::size_t error;
    std::size_t covariate;
    GnuplotWord words;
  };
  constexpr Panel kPanels[] = {{0, 0, "angular rate x, rad/s"},
                               {0, 3, "angular acceleration x, rad/s²"},
                               {0, 6, "angular jerk x, rad/s³"},
                               {5, 11, "specific force z, m/s²"},
                               {5, 14, "linear jerk z, m/s³"}};
  Picture picture{device_file_name("figure3", study.name, ""), 2, 3, {}};
  int n = 0;
  for (const Panel& panel : kPanels) {
    picture.body.add("$points{} << EOD\n", n);
    const auto& x = study.scatter->covariates[panel.covariate];
    const auto& y = study.scatter->errors[panel.error];
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (std::isfinite(x[i]) && std::isfinite(y[i])) picture.body.add("{:.5g} {:.5g}\n", x[i], y[i]);
    }
    const GnuplotText label(fmt::format("error of {}, {}", axis_words(kAxes[panel.error]),
                                        panel.error < kTriad ? "deg/s" : "m/s²"));
    picture.body.add(
        "EOD\nset xlabel '{}'\nset ylabel {}\nplot $points{} using 1:2 with points pointtype 7 "
        "pointsize 0.15 linecolor rgb '{}' notitle\n",
        panel.words, label, n, kPictureColours[panel.error % kTriad]);
    ++n;
  }
  return picture;
}

/// The fits of one axis that a panel shows: those of regimes, or that of everything together.
std::vector<const Fit*> fits_shown(const std::vector<Fit>& fits, const std::string& imu, const char* axis) {
  std::vector<const Fit*> shown;
  for (const Fit& fit : fits) {
    const bool part = fit.regime != "all" && !fit.regime.empty();
    if (fit.imu == imu && fit.axis == axis && part && !fit.levels.empty()) shown.push_back(&fit);
  }
  const Fit* whole = find_fit(fits, imu, axis, "all");
  if (shown.empty() && whole != nullptr && !whole->levels.empty()) shown.push_back(whole);
  return shown;
}

std::optional<Picture> wavelet_picture(const std::vector<Fit>& fits, const std::string& imu) {
  Picture picture{device_file_name("figure4", imu, ""), 2, 3, {}};
  picture.body.add(
      "set logscale xy\nset format '10^{{%L}}'\nset key top right samplen 1\nset xlabel 'scale τ, s'\n");
  bool any = false;
  for (std::size_t axis = 0; axis < std::size(kAxes); ++axis) {
    const auto shown = fits_shown(fits, imu, kAxes[axis]);
    if (shown.empty()) {
      picture.body.add("set multiplot next\n");
      continue;
    }
    any = true;
    GnuplotScript plots;
    for (std::size_t i = 0; i < shown.size(); ++i) {
      const auto block = GnuplotScript::of("axis{}_{}", axis, i);
      picture.body += wavelet_block(block, *shown[i]);
      if (!plots.empty()) plots.add(", ");
      plots += wavelet_plots(block, *shown[i], kPictureColours[(i + 2) % kTriad]);
    }
    picture.body += wavelet_range(shown);
    const GnuplotText label(fmt::format("{}, ({})²", axis_words(kAxes[axis]), shown.front()->unit));
    picture.body.add("set ylabel {} noenhanced\nplot {}\n", label, plots);
  }
  return any ? std::optional(picture) : std::nullopt;
}

std::vector<Picture> pictures_of(const RunFiles& run) {
  std::vector<Picture> pictures;
  if (run.navigation) pictures.push_back(drive_picture(run));
  const auto fits = read_fits(run.models);
  for (const SImuFiles& study : run.studies) {
    if (study.calibration_series) pictures.push_back(estimate_picture(study));
    if (study.errors) pictures.push_back(error_picture(study));
    if (study.scatter) pictures.push_back(scatter_picture(study));
    if (auto wavelet = wavelet_picture(fits, study.name)) pictures.push_back(std::move(*wavelet));
  }
  return pictures;
}

}  // namespace
}  // namespace report

Result<std::vector<std::filesystem::path>> write_figures(const std::filesystem::path& run_dir) {
  const auto run = report::read_run_files(run_dir);
  if (!run) return tl::unexpected<Error>(run.error());
  const auto folder = OutputFolder::open(run_dir);
  if (!folder) return tl::unexpected<Error>(folder.error());
  const auto figures = folder->sub_folder("figures");
  if (!figures) return tl::unexpected<Error>(figures.error());
  std::vector<std::filesystem::path> files;
  for (const report::Picture& picture : report::pictures_of(*run)) {
    if (auto drawn = report::draw_into(*figures, picture); !drawn)
      return tl::unexpected<Error>(drawn.error());
    for (const char* suffix : {".svg", ".pdf"}) files.push_back(figures->path() / (picture.name + suffix));
  }
  return files;
}

}  // namespace imuscope
