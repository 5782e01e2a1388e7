#include "results/report/certificate_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <execution>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "base/units.h"
#include "results/report/fits.h"
#include "results/report/picture.h"
#include "results/report/wavelet_plots.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

using nlohmann::json;

GnuplotNumber shown(const json& row, const char* key, double factor = 1.0) {
  const auto value = number_at(row, key);
  return {value ? factor * *value : std::nan("")};
}

/// What people read: deg/s and m/s². Returns the factor of the numbers.
double shown_axis_unit(const json& axis, std::string& unit) {
  unit = text_at(axis, "unit");
  if (unit == "g") {
    unit = "m/s²";
    return kMps2PerG;
  }
  return shown_unit(unit);
}

/// tau, deviation, interval, model.
GnuplotScript allan_block(const GnuplotScript& name, const json& axis, double factor) {
  auto block = GnuplotScript::of("${} << EOD\n", name);
  for (const auto& p : field(axis, "allan")) {
    block.add("{} {} {} {} {}\n", shown(p, "tau_s"), shown(p, "deviation", factor),
              shown(p, "ci_low", factor), shown(p, "ci_high", factor), shown(p, "model", factor));
  }
  return block.add("EOD\n");
}

GnuplotScript density_block(const GnuplotScript& name, const json& axis, double factor) {
  auto block = GnuplotScript::of("${} << EOD\n", name);
  for (const auto& p : field(axis, "density")) {
    const double square = factor * factor;
    block.add("{} {} {} {}\n", shown(p, "frequency_hz"), shown(p, "density", square),
              shown(p, "ci_low", square), shown(p, "ci_high", square));
  }
  return block.add("EOD\n");
}

/// What a data sheet states of the triad as its Allan deviation would be: N falling, B level (T-1).
GnuplotScript stated_plots(const json& certificate, bool gyro) {
  GnuplotScript plots;
  constexpr double kRootHour = 60.0;
  constexpr double kFlickerAllanDeviation = 0.664;  // IEEE Std 952
  bool walk = false;
  bool bias = false;
  for (const auto& row : field(field(certificate, "comparison"), "rows")) {
    if (text_at(row, "axis").starts_with("gyro") != gyro) continue;
    const std::string symbol = text_at(row, "symbol");
    const double stated = number_at(row, "stated").value_or(std::nan(""));
    if (symbol == "N" && !walk) {
      plots.add(", {}/sqrt(x) with lines linewidth 2 linecolor rgb '#808080' title 'data sheet, N'",
                GnuplotNumber{stated / kRootHour});
      walk = true;
    }
    if (symbol == "B" && !bias) {
      const double level = stated * (gyro ? 1.0 / kSecondsPerHour : kMps2PerMicroG) * kFlickerAllanDeviation;
      plots.add(", {}+0*x with lines linewidth 2 dashtype 3 linecolor rgb '#808080' title 'data sheet, B'",
                GnuplotNumber{level});
      bias = true;
    }
  }
  return plots;
}

/// Allan deviations of the gyroscopes or of the accelerometers in one picture.
Picture overview_picture(const json& certificate, bool gyro) {
  Picture picture{gyro ? "allan_gyroscopes" : "allan_accelerometers", 1, 1, {}};
  picture.body.add(
      "set logscale xy\nset format '10^{{%L}}'\nset key top right samplen 2\nset xlabel 'averaging time τ, "
      "s'\n");
  GnuplotScript plots;
  std::size_t n = 0;
  std::string unit;
  for (const auto& axis : field(certificate, "axes")) {
    if (is_gyro_axis(axis) != gyro) continue;
    const double factor = shown_axis_unit(axis, unit);
    const auto block = GnuplotScript::of("axis{}", n);
    picture.body += allan_block(block, axis, factor);
    const GnuplotWord& colour = kPictureColours[n % std::size(kPictureColours)];
    if (!plots.empty()) plots.add(", ");
    plots.add(
        "${0} using 1:3:4 with filledcurves fillcolor rgb '{1}' fillstyle transparent solid 0.25 noborder "
        "notitle, ${0} using 1:2 with linespoints pointtype 7 pointsize 0.3 linecolor rgb '{1}' title {2} "
        "noenhanced, ${0} using 1:5 with lines dashtype 2 linecolor rgb '{1}' notitle",
        block, colour, GnuplotText(axis_words(text_at(axis, "name"))));
    ++n;
  }
  if (plots.empty()) return picture;
  plots += stated_plots(certificate, gyro);
  picture.body.add("set ylabel {}\nplot {}\n", GnuplotText("Allan deviation, " + unit), plots);
  return picture;
}

Picture axis_picture(const json& axis, std::size_t place) {
  std::string unit;
  const double factor = shown_axis_unit(axis, unit);
  Picture picture{fmt::format("axis{}", place + 1), 1, 3, {}};
  picture.body.add("set logscale xy\nset format '10^{{%L}}'\nset key top right samplen 1\n");
  const auto allan = GnuplotScript::of("allan");
  picture.body += allan_block(allan, axis, factor);
  picture.body.add(
      "set xlabel 'averaging time τ, s'\nset ylabel {}\nplot $allan using 1:3:4 with filledcurves "
      "fillcolor rgb '{}' fillstyle transparent solid 0.3 noborder notitle, $allan using 1:2 with points "
      "pointtype 7 pointsize 0.3 linecolor rgb '{}' title 'Allan deviation', $allan using 1:5 with lines "
      "linecolor rgb '#000000' title 'model'\n",
      GnuplotText(unit), kPictureColours[2], kPictureColours[2]);
  json entry = field(axis, "fit");
  entry["axis"] = text_at(axis, "name");
  entry["regime"] = "wavelet variance";
  entry["unit"] = text_at(axis, "unit");
  const auto fits = read_fits(json::array({entry}));
  if (fits.empty()) {
    picture.body.add("set multiplot next\n");
  } else {
    const auto block = GnuplotScript::of("wv");
    picture.body += wavelet_block(block, fits.front());
    picture.body += wavelet_range({&fits.front()});
    picture.body.add("set xlabel 'scale τ, s'\nset ylabel {} noenhanced\nplot {}\nset yrange [*:*]\n",
                     GnuplotText("(" + fits.front().unit + ")²"),
                     wavelet_plots(block, fits.front(), kPictureColours[2]));
  }
  const auto density = GnuplotScript::of("density");
  picture.body += density_block(density, axis, factor);
  picture.body.add(
      "set xlabel 'frequency, Hz'\nset ylabel {}\nplot $density using 1:3:4 with filledcurves fillcolor rgb "
      "'{}' fillstyle transparent solid 0.3 noborder notitle, $density using 1:2 with lines linecolor rgb "
      "'{}' title 'spectral density'\n",
      GnuplotText("(" + unit + ")²/Hz"), kPictureColours[0], kPictureColours[0]);
  return picture;
}

}  // namespace

bool is_gyro_axis(const json& axis) {
  const std::string unit = text_at(axis, "unit");
  return unit == "rad/s" || unit == "deg/s";
}

Result<CertificateFigures> draw_certificate(const OutputFolder& folder, const json& certificate) {
  const auto drawn = folder.sub_folder("figures");
  if (!drawn) return tl::unexpected<Error>(drawn.error());
  CertificateFigures out;
  std::vector<Picture> pictures;
  for (const bool gyro : {true, false}) {
    const json& axes = field(certificate, "axes");
    if (std::none_of(axes.begin(), axes.end(), [&](const auto& axis) { return is_gyro_axis(axis) == gyro; }))
      continue;
    pictures.push_back(overview_picture(certificate, gyro));
    out.overview.emplace_back(
        drawn->path() / (pictures.back().name + ".svg"),
        fmt::format("Allan deviation of the {}: measured, with its interval, and of the model (dashed).",
                    gyro ? "gyroscopes" : "accelerometers"));
  }
  for (const auto& axis : field(certificate, "axes")) {
    pictures.push_back(axis_picture(axis, out.of_axes.size()));
    out.of_axes.push_back(drawn->path() / (pictures.back().name + ".svg"));
  }
  // Each is a program of its own.
  std::vector<Result<void>> done(pictures.size());
  std::transform(std::execution::par, pictures.begin(), pictures.end(), done.begin(),
                 [&](const Picture& picture) { return draw_into(*drawn, picture); });
  for (auto& result : done) {
    if (!result) return tl::unexpected<Error>(result.error());
  }
  return out;
}

}  // namespace imuscope::report
