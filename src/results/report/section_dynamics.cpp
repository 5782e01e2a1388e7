#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>

#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

using nlohmann::json;

/// Coefficients that are shown: p corrected for the number of all; where a run does not have that, for the
/// fifteen of an axis.
constexpr double kShownP = 0.05;
constexpr double kOfAnAxis = 15.0;
constexpr std::size_t kShownMax = 4;

/// What Figure 3 draws: an error axis, its own covariates.
struct Pair {
  std::size_t error;
  std::size_t covariate;
};
constexpr Pair kPairs[] = {{0, 0}, {0, 3}, {0, 6},  {1, 1},  {1, 4},  {1, 7},  {2, 2}, {2, 5},
                           {2, 8}, {3, 9}, {3, 12}, {4, 10}, {4, 13}, {5, 11}, {5, 14}};
struct DrivingQuantity {
  const char* name;
  const char* unit;
};
constexpr DrivingQuantity kQuantities[] = {{"angular rate", "rad/s"},
                                           {"angular acceleration", "rad/s²"},
                                           {"angular jerk", "rad/s³"},
                                           {"specific force", "m/s²"},
                                           {"linear jerk", "m/s³"}};

Html percent(std::optional<double> r2) {
  return r2 ? text(fmt::format("{:.2f} %", 100.0 * *r2)) : text(kUnknown);
}

/// The regression of an axis; null where there is none.
const json& find_regression(const json& regressions, const std::string& imu, const std::string& axis,
                            const char* method, bool projected) {
  static const json kNone;
  for (const json& entry : regressions) {
    const json& is_projected = field(entry, "projected");
    if (text_at(entry, "name") == imu && text_at(entry, "axis") == axis &&
        text_at(entry, "method") == method &&
        (is_projected.is_boolean() ? is_projected.get<bool>() : false) == projected) {
      return entry;
    }
  }
  return kNone;
}

/// Coefficients that are clear of chance.
std::vector<const json*> shown_coefficients(const json& regression) {
  std::vector<const json*> shown;
  for (const json& c : field(regression, "coefficients")) {
    const double p_of_axis = kOfAnAxis * number_at(c, "p_value").value_or(1.0);
    if (number_at(c, "p_holm").value_or(p_of_axis) < kShownP) shown.push_back(&c);
  }
  return shown;
}

/// The strongest coefficients in words, strongest first.
Html effects(const json& regression) {
  if (!field(regression, "coefficients").is_array()) return text(kUnknown);
  std::vector<const json*> shown = shown_coefficients(regression);
  std::sort(shown.begin(), shown.end(), [](const json* a, const json* b) {
    const auto strength = [](const json& c) {
      return std::abs(number_at(c, "value").value_or(0.0)) / number_at(c, "sd").value_or(1.0);
    };
    return strength(*a) > strength(*b);
  });
  if (shown.empty()) return text("none that stands out");
  if (shown.size() > kShownMax) shown.resize(kShownMax);
  Html items;
  for (const json* c : shown) {
    items += element("li", text(text_at(*c, "covariate") + ": " + text_at(*c, "means")));
  }
  return element("ul", items);
}

Html regression_table(const json& regressions, const std::string& imu) {
  Table table({text("axis"), text("R²"), text("F"), text("p"), text("p, noise's memory counted"),
               text("R² projected"), text("p projected"), text("what is left would mean")});
  for (const char* axis : kAxes) {
    const json& ols = find_regression(regressions, imu, axis, "ols", false);
    const json& gls = find_regression(regressions, imu, axis, "gls", false);
    const json& projected = find_regression(regressions, imu, axis, "gls", true);
    if (ols.is_null() && gls.is_null() && projected.is_null()) continue;
    table.add_row({text(axis_words(axis)), percent(number_at(ols, "r2")), number(number_at(ols, "f"), 3),
                   p_words(number_at(ols, "p_value")), p_words(number_at(gls, "p_value")),
                   percent(number_at(projected, "r2")), p_words(number_at(projected, "p_value")),
                   effects(projected)});
  }
  return table.empty() ? paragraph("Nothing moved enough, or no sample was left, for a regression.")
                       : table.html();
}

/// Points of a figure this small that can be told apart.
constexpr std::size_t kPointsShown = 1000;

/// A long column, thinned evenly to what a figure can show.
std::vector<double> thinned(const std::vector<double>& values) {
  const std::size_t step = std::max<std::size_t>(1, (values.size() + kPointsShown - 1) / kPointsShown);
  std::vector<double> kept;
  for (std::size_t i = 0; i < values.size(); i += step) kept.push_back(values[i]);
  return kept;
}

Html scatter_panels(const SImuFiles& study, FigureSheet& figures) {
  std::array<std::size_t, kScatterCovariates> x_columns{};
  std::array<std::size_t, kScatterErrors> y_columns{};
  for (std::size_t i = 0; i < x_columns.size(); ++i)
    x_columns[i] = figures.add_column(thinned(study.scatter->covariates[i]));
  for (std::size_t i = 0; i < y_columns.size(); ++i)
    y_columns[i] = figures.add_column(thinned(study.scatter->errors[i]));
  Html panels;
  for (const Pair& pair : kPairs) {
    const double r =
        correlation(study.scatter->covariates[pair.covariate], study.scatter->errors[pair.error]);
    const DrivingQuantity& quantity = kQuantities[pair.covariate / 3];
    const char* unit = pair.error < 3 ? "deg/s" : "m/s²";
    const std::string caption =
        fmt::format("{}, {}, against its axis' {}{}", axis_words(kAxes[pair.error]), unit, quantity.name,
                    std::isfinite(r) ? fmt::format("; r = {:.3f}", r) : "");
    panels += figures.scatter_figure(fmt::format("scatter-{}-{}-{}", kAxes[pair.error],
                                                 kScatterCovariateColumns[pair.covariate], study.name),
                                     fmt::format("{}, {}", quantity.name, quantity.unit), unit,
                                     x_columns[pair.covariate], y_columns[pair.error],
                                     static_cast<int>(pair.error % 3), text(caption));
  }
  return element("div", panels, "panels");
}

/// "gyroscope z against angular rate, r = 0.41": the strongest of the figure's pairs.
std::string strongest_pair(const SImuFiles& study) {
  std::string words;
  double strongest = 0.0;
  for (const Pair& pair : kPairs) {
    const double r =
        correlation(study.scatter->covariates[pair.covariate], study.scatter->errors[pair.error]);
    if (!(std::abs(r) > strongest)) continue;
    strongest = std::abs(r);
    words = fmt::format("{} against {}, r = {:.2g}", axis_words(kAxes[pair.error]),
                        kQuantities[pair.covariate / 3].name, r);
  }
  return words.empty() ? "" : "; strongest: " + words;
}

/// Axes on which something of the sensor's own stands out once the calibration's errors are taken out.
std::vector<std::string> axes_that_depend(const json& regressions, const std::string& imu) {
  std::vector<std::string> axes;
  for (const char* axis : kAxes) {
    const json& projected = find_regression(regressions, imu, axis, "gls", true);
    if (!projected.is_null() && !shown_coefficients(projected).empty()) axes.push_back(axis_words(axis));
  }
  return axes;
}

}  // namespace

Html dynamics_section(const RunFiles& run, FigureSheet& figures) {
  Html section = heading("motion", "Figure 3: errors against the motion");
  const bool any = std::any_of(run.studies.begin(), run.studies.end(),
                               [](const SImuFiles& study) { return study.scatter.has_value(); });
  if (any) {
    section += paragraph(
        "Samples spread evenly over the drive: the error of an axis against the motion about or along the "
        "same axis. r: correlation of the points shown.");
  }
  for (const SImuFiles& study : run.studies) {
    if (study.scatter) section += fold(study.name + strongest_pair(study), scatter_panels(study, figures));
  }
  if (!any) section += paragraph("No scatter_NAME.csv in this run: the figure is left out.");

  section += heading("table-1", "Table I: do the errors depend on the motion?");
  if (!run.regressions.is_array() || run.regressions.empty()) {
    return section +
           paragraph("No regression.json in this run: the dependence on the motion was not studied.");
  }
  section += paragraph(
      "Linear regression on fifteen covariates: angular rate, acceleration and jerk, specific force and "
      "linear jerk. R², F and the first p are those of ordinary least squares, which takes slow noise for "
      "dependence. The second p counts the noise's memory, by the model fitted to the residual. Projected: "
      "what errors of the calibration (boresight, scale, time offset, lever arm) would produce is taken out "
      "first; what is left is the sensor's own. The last column names the fault that a coefficient would "
      "stand for, where it is clear of chance.");
  for (const auto& remark : run.regression_remarks) {
    if (remark.is_string()) section += paragraph(remark.get<std::string>(), "note");
  }
  for (const SImuFiles& study : run.studies) {
    const auto axes = axes_that_depend(run.regressions, study.name);
    const std::string words = axes.empty()
                                  ? study.name + ": nothing of the sensor's own stands out on any axis"
                                  : fmt::format("{}: something of the sensor's own stands out on {}",
                                                study.name, fmt::join(axes, ", "));
    section += fold(words, regression_table(run.regressions, study.name), !axes.empty());
  }
  return section;
}

}  // namespace imuscope::report
