#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/units.h"
#include "results/report/mounting.h"
#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::numbers_at;
using tables::text_at;

using Three = std::array<double, 3>;

constexpr std::array<char, 3> kAxisNames{'x', 'y', 'z'};
constexpr double kPpm = 1e6;
constexpr double kMdegPerDeg = 1e3;

Html bold_sub(const char* symbol, const char* index) { return text(symbol) + element("sub", text(index)); }

/// Name of a row that belongs to the quantity above it.
Html subordinate(const char* name) { return element("span", text(name), "subordinate"); }

/// A quantity of three axes as it stands in calibration.json and in truth.json.
struct Quantity {
  Html name;
  const char* value_key;
  const char* sd_key;
  double unit;           ///< factor from the file's unit to the shown one
  bool wanders = false;  ///< its truth is that of the turn-on
  std::array<bool, 3> observable{true, true, true};
};

/// Said where the motion has not shown a state: its number would say what nobody knows.
constexpr const char* kNotObservable = "not observable yet";

bool is_observable(const nlohmann::json& calibration, const std::string& state) {
  return field(field(calibration, "observable"), state.c_str()) != nlohmann::json(false);
}

/// Components of "psi" or "r" that the motion has shown.
std::array<bool, 3> observable_axes(const nlohmann::json& calibration, const char* quantity) {
  std::array<bool, 3> axes{};
  for (std::size_t i = 0; i < axes.size(); ++i)
    axes[i] = is_observable(calibration, fmt::format("{}_{}", quantity, kAxisNames[i]));
  return axes;
}

std::vector<Html> row_of_three(Html name, const std::optional<Three>& values, const std::optional<Three>& sd,
                               double unit, const std::array<bool, 3>& observable = {true, true, true}) {
  std::vector<Html> row{std::move(name)};
  for (std::size_t i = 0; i < kAxisNames.size(); ++i) {
    if (!observable[i]) {
      row.push_back(text(kNotObservable));
    } else if (!values) {
      row.push_back(text(kUnknown));
    } else {
      row.push_back(with_sd(unit * (*values)[i], sd ? std::optional(unit * (*sd)[i]) : std::nullopt));
    }
  }
  return row;
}

Html error_cell(double error, const char* unit, std::optional<double> sd) {
  Html cell = number(error, 2) + text(std::string(" ") + unit);
  if (sd) cell += element("span", text(" (" + in_sd(error, sd) + ")"), "interval");
  return cell;
}

/// Found, true and difference of one quantity.
void add_quantity(Table& table, const SImuFiles& study, const Quantity& quantity, const char* error_unit,
                  double error_factor) {
  const auto found = numbers_at<3>(study.calibration, quantity.value_key);
  const auto sd = numbers_at<3>(study.calibration, quantity.sd_key);
  if (!found) return;
  table.add_row(row_of_three(quantity.name, found, sd, quantity.unit, quantity.observable));
  const auto known = numbers_at<3>(study.truth, quantity.value_key);
  if (!known) return;
  // A bias wanders during the drive: its end cannot be judged by where it began.
  table.add_row(
      row_of_three(subordinate(quantity.wanders ? "truth at turn-on" : "truth"), known, {}, quantity.unit));
  if (quantity.wanders) return;
  std::vector<Html> row{subordinate("error")};
  for (std::size_t i = 0; i < kAxisNames.size(); ++i) {
    row.push_back(error_cell(error_factor * ((*found)[i] - (*known)[i]), error_unit,
                             sd ? std::optional(error_factor * (*sd)[i]) : std::nullopt));
  }
  table.add_row(std::move(row));
}

void add_boresight(Table& table, const SImuFiles& study, const Rotation& C_b_s) {
  const auto sd_deg = numbers_at<3>(study.calibration, "boresight_sd_deg");
  const Rotation square = nearest_square_mounting(C_b_s);
  const auto observable = observable_axes(study.calibration, "psi");
  table.add_row(row_of_three(text("boresight from the square mounting, deg"), boresight_deg(square, C_b_s),
                             sd_deg, 1.0, observable));
  if (const auto prior = numbers_at<9>(study.calibration, "C_prior")) {
    table.add_row(row_of_three(text("boresight from the coarse alignment (Figure 1), deg"),
                               boresight_deg(*prior, C_b_s), sd_deg, 1.0, observable));
  }
  const auto true_C = numbers_at<9>(study.truth, "C_b_s");
  if (!true_C) return;
  table.add_row(
      row_of_three(subordinate("truth, from the square mounting"), boresight_deg(square, *true_C), {}, 1.0));
  const Angles error_deg = boresight_deg(*true_C, C_b_s);
  std::vector<Html> row{subordinate("error")};
  for (std::size_t i = 0; i < error_deg.size(); ++i) {
    row.push_back(error_cell(kMdegPerDeg * error_deg[i], "mdeg",
                             sd_deg ? std::optional(kMdegPerDeg * (*sd_deg)[i]) : std::nullopt));
  }
  table.add_row(std::move(row));
}

void add_time_offset(Table& table, const SImuFiles& study) {
  const auto t_d_s = number_at(study.calibration, "t_d_s");
  const auto sd_s = number_at(study.calibration, "t_d_sd_s");
  if (!t_d_s) return;
  const auto in_ms = [](std::optional<double> seconds) {
    return seconds ? std::optional(kMsPerS * *seconds) : std::nullopt;
  };
  table.add_row({bold_sub("time offset t", "d") + text(", ms"),
                 is_observable(study.calibration, "t_d") ? with_sd(kMsPerS * *t_d_s, in_ms(sd_s))
                                                         : text(kNotObservable),
                 {},
                 {}});
  const auto known_s = number_at(study.truth, "t_d_s");
  if (!known_s) return;
  table.add_row({subordinate("truth"), number(kMsPerS * *known_s), {}, {}});
  table.add_row({subordinate("error"), error_cell(kMsPerS * (*t_d_s - *known_s), "ms", in_ms(sd_s)), {}, {}});
}

Html study_table(const SImuFiles& study) {
  Table table({text("± one sd"), text("x"), text("y"), text("z")});
  if (const auto C_b_s = numbers_at<9>(study.calibration, "C_b_s")) add_boresight(table, study, *C_b_s);
  add_quantity(table, study,
               {text("lever arm r, mm"), "r_bs_b_m", "r_bs_b_sd_m", kMmPerM, false,
                observable_axes(study.calibration, "r")},
               "mm", kMmPerM);
  add_time_offset(table, study);
  add_quantity(
      table, study,
      {text("gyroscope bias at the end, deg/s"), "gyro_bias_radps", "gyro_bias_sd_radps", kDegPerRad, true},
      "mdeg/s", kMdegPerDeg * kDegPerRad);
  add_quantity(
      table, study,
      {text("accelerometer bias at the end, m/s²"), "accel_bias_mps2", "accel_bias_sd_mps2", 1.0, true},
      "mm/s²", kMmPerM);
  add_quantity(table, study, {text("gyroscope scale error, ppm"), "gyro_scale", "gyro_scale_sd", kPpm}, "ppm",
               kPpm);
  add_quantity(table, study, {text("accelerometer scale error, ppm"), "accel_scale", "accel_scale_sd", kPpm},
               "ppm", kPpm);
  add_quantity(table, study,
               {text("accelerometer triad turned against the gyroscopes', deg"), "accel_boresight_deg",
                "accel_boresight_sd_deg", 1.0},
               "mdeg", kMdegPerDeg);
  return table.html();
}

/// What each axis of a triad reads of the others' directions: the matrix less scale and right angles.
Html axes_table(const SImuFiles& study) {
  const auto& batch = field(study.calibration, "batch");
  Table table(
      {text("leaning axes, deg ± one sd"), text("y towards x"), text("z towards x"), text("z towards y")});
  const auto add = [&](const char* name, const char* matrix_key, const char* sd_key) {
    const auto m = numbers_at<9>(batch, matrix_key);
    if (!m) return false;
    const Three leaning{(*m)[3] * kDegPerRad, (*m)[6] * kDegPerRad, (*m)[7] * kDegPerRad};
    table.add_row(row_of_three(text(name), leaning, numbers_at<3>(batch, sd_key), 1.0));
    return true;
  };
  const bool gyro = add("gyroscopes", "gyro_matrix", "gyro_axes_sd_deg");
  const bool accel = add("accelerometers", "accel_matrix", "accel_axes_sd_deg");
  return gyro || accel ? table.html() : Html{};
}

Html mounting_words(const SImuFiles& study) {
  const auto C_b_s = numbers_at<9>(study.calibration, "C_b_s");
  if (!C_b_s) return paragraph("The mounting is not known.");
  std::string words = fmt::format("Mounted with its {} of the reference, but for the small angles below.",
                                  square_mounting_words(nearest_square_mounting(*C_b_s)));
  if (const auto q = numbers_at<4>(study.calibration, "q_b_s")) {
    words += fmt::format(" Quaternion from b to s (scalar first): {:.7f}, {:.7f}, {:.7f}, {:.7f}.", (*q)[0],
                         (*q)[1], (*q)[2], (*q)[3]);
  }
  const std::string method = text_at(study.calibration, "method");
  if (!method.empty()) words += fmt::format(" Method: {}.", method);
  return paragraph(words);
}

/// The unit in which people read a small length or time; returns the factor of its numbers.
double small_unit(std::string& unit) {
  if (unit == "m") {
    unit = "mm";
    return kMmPerM;
  }
  if (unit == "s") {
    unit = "ms";
    return kMsPerS;
  }
  return 1.0;
}

/// What is known least and what would help.
Html limits_words(const SImuFiles& study) {
  const auto& observability = field(study.calibration, "observability");
  if (!observability.is_object()) return {};
  std::string words =
      fmt::format("Least is known of the {}.", text_at(field(observability, "weakest"), "words"));
  if (const std::string limits = text_at(observability, "limited_by"); !limits.empty())
    words += fmt::format(" Limited: {}.", limits);
  if (const std::string advice = text_at(observability, "advice"); !advice.empty())
    words += fmt::format(" What would help: {}.", advice);
  return paragraph(words);
}

/// sd against goal of every state.
Html observability_table(const SImuFiles& study) {
  const auto& observability = field(study.calibration, "observability");
  if (!observability.is_object()) return {};
  Table table({text("what the drive has shown"), text("sd"), text("goal"), text("")});
  for (const auto& state : field(observability, "states")) {
    const auto sd = number_at(state, "sd");
    const auto goal = number_at(state, "goal");
    const bool seen = field(state, "observable") == nlohmann::json(true);
    const bool reached = field(state, "goal_reached") == nlohmann::json(true);
    std::string unit = text_at(state, "unit");
    const double factor = small_unit(unit);
    if (!sd || !goal) continue;
    table.add_row({text(text_at(state, "words")),
                   seen ? number(factor * *sd, 2) + text(" " + unit) : text(kNotObservable),
                   number(factor * *goal, 2) + text(" " + unit),
                   text(reached ? "goal reached"
                        : seen  ? "goal not reached"
                                : "")});
  }
  return table.html();
}

/// An estimate, and below it how far it is from the truth where that is known.
Html found_cell(std::optional<double> value, std::optional<double> sd, std::optional<double> truth,
                double unit, bool observable) {
  if (!observable) return text(kNotObservable);
  if (!value) return text(kUnknown);
  const auto in_unit = [&](std::optional<double> any) { return any ? std::optional(unit * *any) : any; };
  Html cell = with_sd(unit * *value, in_unit(sd));
  if (truth) cell += element("span", text("off by " + in_sd(unit * (*value - *truth), in_unit(sd))), "aside");
  return cell;
}

/// The three of one quantity of one S-IMU.
std::array<Html, 3> found_cells(const std::optional<Three>& values, const std::optional<Three>& sd,
                                const std::optional<Three>& truth, double unit,
                                const std::array<bool, 3>& observable) {
  std::array<Html, 3> cells;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto at = [&](const std::optional<Three>& three) {
      return three ? std::optional((*three)[i]) : std::nullopt;
    };
    cells[i] = found_cell(at(values), at(sd), at(truth), unit, observable[i]);
  }
  return cells;
}

/// Boresight from the square mounting, lever arm and time offset of one S-IMU, in the order of kMountingRows.
std::vector<Html> mounting_cells(const SImuFiles& study) {
  std::vector<Html> cells;
  const auto add = [&](const std::array<Html, 3>& three) {
    cells.insert(cells.end(), three.begin(), three.end());
  };
  const auto C_b_s = numbers_at<9>(study.calibration, "C_b_s");
  const auto true_C = numbers_at<9>(study.truth, "C_b_s");
  std::optional<Three> psi_deg;
  std::optional<Three> true_psi_deg;
  if (C_b_s) {
    const Rotation square = nearest_square_mounting(*C_b_s);
    psi_deg = boresight_deg(square, *C_b_s);
    if (true_C) {
      // The error is the small rotation between both, whatever the square mounting is.
      const Angles error_deg = boresight_deg(*true_C, *C_b_s);
      true_psi_deg = Three{};
      for (std::size_t i = 0; i < error_deg.size(); ++i) (*true_psi_deg)[i] = (*psi_deg)[i] - error_deg[i];
    }
  }
  add(found_cells(psi_deg, numbers_at<3>(study.calibration, "boresight_sd_deg"), true_psi_deg, 1.0,
                  observable_axes(study.calibration, "psi")));
  add(found_cells(numbers_at<3>(study.calibration, "r_bs_b_m"),
                  numbers_at<3>(study.calibration, "r_bs_b_sd_m"), numbers_at<3>(study.truth, "r_bs_b_m"),
                  kMmPerM, observable_axes(study.calibration, "r")));
  cells.push_back(found_cell(number_at(study.calibration, "t_d_s"), number_at(study.calibration, "t_d_sd_s"),
                             number_at(study.truth, "t_d_s"), kMsPerS,
                             is_observable(study.calibration, "t_d")));
  return cells;
}

/// All S-IMUs beside each other.
Html mounting_table(const RunFiles& run) {
  constexpr const char* kMountingRows[] = {"boresight ψ about forward, deg",
                                           "about right, deg",
                                           "about down, deg",
                                           "lever arm r forward, mm",
                                           "right, mm",
                                           "down, mm",
                                           "time offset t_d, ms"};
  std::vector<Html> headings{text("± one sd")};
  std::vector<std::vector<Html>> columns;
  for (const SImuFiles& study : run.studies) {
    headings.push_back(text(study.name));
    columns.push_back(mounting_cells(study));
  }
  Table table(std::move(headings));
  for (std::size_t row = 0; row < std::size(kMountingRows); ++row) {
    std::vector<Html> cells{text(kMountingRows[row])};
    for (const auto& column : columns) cells.push_back(column[row]);
    table.add_row(std::move(cells));
  }
  return columns.empty() ? Html{} : table.html();
}

Html estimate_panels(const SImuFiles& study, FigureSheet& figures) {
  if (!study.calibration_series) {
    return paragraph(fmt::format(
        "No calibration_{}.csv with estimates in this run folder: Figure 1 has nothing to show for it.",
        study.name));
  }
  const BinnedSignals& series = *study.calibration_series;
  std::optional<Angles> true_psi_deg;
  const auto prior = numbers_at<9>(study.calibration, "C_prior");
  const auto true_C = numbers_at<9>(study.truth, "C_b_s");
  if (prior && true_C) true_psi_deg = boresight_deg(*prior, *true_C);
  const auto true_r_m = numbers_at<3>(study.truth, "r_bs_b_m");
  Html panels;
  const auto add_panel = [&](const char* what, const char* symbol, std::size_t signal, std::size_t axis,
                             double unit, const char* unit_name, std::optional<double> truth) {
    Figure figure;
    figure.id = fmt::format("{}-{}-{}", what, kAxisNames[axis], study.name);
    figure.group = "estimates of " + study.name;
    figure.y_label = unit_name;
    figure.truth = truth;
    figure.shaded = study.static_stretches;
    figure.window = settled_window(series, signal + axis, signal + axis + kSdOffset, unit, truth);
    panels += figures.estimate_figure(
        figure, series, signal + axis, signal + axis + kSdOffset, unit, static_cast<int>(axis),
        text(symbol) + element("sub", text({&kAxisNames[axis], 1})) + text(fmt::format(", {}", unit_name)));
  };
  for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
    add_panel("psi", "ψ", kPsi_deg, axis, 1.0, "deg",
              true_psi_deg ? std::optional((*true_psi_deg)[axis]) : std::nullopt);
  }
  for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
    add_panel("r", "r", kLeverArm_m, axis, kMmPerM, "mm",
              true_r_m ? std::optional(kMmPerM * (*true_r_m)[axis]) : std::nullopt);
  }
  return element("div", panels, "panels");
}

/// Whether the mounting is not as it should be: then all that is known of it is open from the beginning.
bool is_notable(const SImuFiles& study) {
  const auto& states = field(field(study.calibration, "observability"), "states");
  return std::any_of(states.begin(), states.end(),
                     [](const auto& state) { return field(state, "observable") != nlohmann::json(true); });
}

}  // namespace

Html calibration_section(const RunFiles& run, FigureSheet& figures) {
  Html section = heading("mounting", "The mounting of each S-IMU");
  section += paragraph(
      "b is the frame of the reference IMU (x forward, y right, z down), s that of the sensor under study. "
      "The boresight ψ is what is left beside the nearest square mounting, a rotation vector in b; the "
      "lever arm r leads from b to s, in b. A positive time offset is added to the sensor's time stamps.");
  section += mounting_table(run);
  if (!run.has_truth)
    section += paragraph("No truth.json in this run: nothing to compare the estimates with.", "note");
  for (const SImuFiles& study : run.studies) {
    section += element("h3", text(study.name)) + mounting_words(study) + limits_words(study) +
               fold(fmt::format("All that is estimated of {}, and what the drive has shown", study.name),
                    study_table(study) + axes_table(study) + observability_table(study), is_notable(study));
  }
  section += heading("figure-1", "Figure 1: boresight and lever arm over time");
  section += element("p", text("Line: the estimate at that time; band: ± one sd") +
                              text(run.has_truth ? "; dashed: the truth" : "") +
                              text("; darker ground: at rest. Heights are chosen to show the settled "
                                   "estimates; drag to zoom, double click to return. ") +
                              Html::markup("<button type=\"button\" id=\"whole-range\" "
                                           "aria-pressed=\"false\">show the whole range</button>"));
  for (const SImuFiles& study : run.studies)
    section += fold(study.name, estimate_panels(study, figures), &study == &run.studies.front());
  return section;
}

}  // namespace imuscope::report
