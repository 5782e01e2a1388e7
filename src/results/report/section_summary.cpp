#include <fmt/format.h>

#include <cmath>

#include "base/calibration_levels.h"
#include "base/units.h"
#include "results/report/data_sheet_table.h"
#include "results/report/page_parts.h"
#include "results/report/sections.h"
#include "results/report/verdict.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::numbers_at;
using tables::text_at;

using nlohmann::json;

/// A question, its answer, and behind a click why.
Html tile(const std::string& question, const Verdict& verdict) {
  const Html why = verdict.reasons.empty() ? Html{} : fold("Why", list_of(verdict.reasons));
  return element("div", element("h3", text(question)) + paragraph(verdict.headline, "headline") + why,
                 std::string("tile ") + css_class_of(verdict.answer));
}

/// What is wrong with the data, before anything that was made of them; nothing where nothing harms.
Html findings_block(const RunFiles& run) {
  const auto wrong = findings_of(run, "wrong");
  const auto limits = findings_of(run, "limits");
  Html block;
  if (!wrong.empty()) {
    block += element("div",
                     element("h3", text("What is wrong with the data or the configuration")) + list_of(wrong),
                     "answer no");
  }
  if (!limits.empty())
    block +=
        element("div", element("h3", text("What limits the results")) + list_of(limits), "answer partly");
  return block;
}

Html tiles(const RunFiles& run, const std::vector<Fit>& fits) {
  Html all = tile("Is the calibration usable?", calibration_verdict(run));
  if (!field(run.run, "findings").is_null()) all += tile("Are the data sound?", data_verdict(run));
  all += tile("Is the noise model adequate?", model_verdict(fits));
  if (!run.comparison.is_null()) all += tile("Do rest and motion differ?", difference_verdict(run));
  if (!run.evaluation.is_null())
    all += tile("Does it matter which model a filter holds?", outage_verdict(run));
  return element("div", all, "tiles");
}

/// Largest of three sd, in another unit.
std::string largest_words(const SImuFiles& study, const char* key, double factor, const char* unit) {
  const auto sd = numbers_at<3>(study.calibration, key);
  if (!sd) return "?";
  return fmt::format("{:.2g} {}", factor * std::max({(*sd)[0], (*sd)[1], (*sd)[2]}), unit);
}

Html drawing(const RunFiles& run) {
  std::vector<DrawnImu> imus;
  std::string known;
  for (const SImuFiles& study : run.studies) {
    const auto C_b_s = numbers_at<9>(study.calibration, "C_b_s");
    const auto r_bs_b_m = numbers_at<3>(study.calibration, "r_bs_b_m");
    if (!C_b_s || !r_bs_b_m) continue;
    imus.push_back({study.name, *C_b_s, *r_bs_b_m});
    known += fmt::format("{}{} to {} and {}", known.empty() ? "" : ", ", study.name,
                         largest_words(study, "boresight_sd_deg", 1.0, "deg"),
                         largest_words(study, "r_bs_b_sd_m", kMmPerM, "mm"));
  }
  if (imus.empty()) return {};
  return element("h3", text("How the S-IMUs sit")) + mounting_drawing(imus) +
         paragraph(fmt::format(
                       "Found, not given: {} (largest sd). Square: the reference; arrows: the sensors' axes.",
                       known),
                   "note");
}

/// Points of several series at one abscissa stand side by side.
double beside(double at, std::size_t i, std::size_t n) {
  constexpr double kStep = 0.06;
  return at * std::exp(kStep * (static_cast<double>(i) - 0.5 * static_cast<double>(n - 1)));
}

/// Root of the measured wavelet variance over the model's, of every axis and regime, by S-IMU.
std::vector<AgreementSeries> of_models(const RunFiles& run, const std::vector<Fit>& fits) {
  const auto regimes = particular_regimes(regimes_of(fits));
  std::vector<AgreementSeries> all;
  for (std::size_t i = 0; i < run.studies.size(); ++i) {
    AgreementSeries series{run.studies[i].name, {}};
    for (const std::string& regime : regimes) {
      for (const char* axis : kAxes) {
        const Fit* fit = find_fit(fits, series.name, axis, regime);
        if (fit == nullptr) continue;
        for (const FitLevel& level : fit->levels) {
          if (!level.value || !level.fitted || !(*level.fitted > 0.0) || !(*level.value > 0.0)) continue;
          const auto ratio = [&](std::optional<double> variance) {
            return std::sqrt(std::max(0.0, variance.value_or(*level.value)) / *level.fitted);
          };
          series.points.push_back({beside(level.tau_s, i, run.studies.size()), ratio(level.value),
                                   ratio(level.ci_low), ratio(level.ci_high)});
        }
      }
    }
    if (!series.points.empty()) all.push_back(std::move(series));
  }
  return all;
}

/// Error after GNSS outages over what the filter predicted, by model.
std::vector<AgreementSeries> of_outages(const RunFiles& run) {
  std::vector<AgreementSeries> all;
  for (const json& row : field(run.evaluation, "evaluations")) {
    const auto at = number_at(row, "duration_s");
    const auto error = number_at(row, "horizontal_rms_m");
    const auto sd = number_at(row, "horizontal_sd_m");
    if (!at || !error || !sd || !(*sd > 0.0)) continue;
    const std::string model = text_at(row, "model");
    auto series =
        std::find_if(all.begin(), all.end(), [&](const AgreementSeries& one) { return one.name == model; });
    if (series == all.end()) series = all.insert(all.end(), {model, {}});
    const double ratio = *error / *sd;
    series->points.push_back({*at, ratio, ratio, ratio});
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (AgreementPoint& point : all[i].points) point.at = beside(point.at, i, all.size());
  }
  return all;
}

Html agreement(const RunFiles& run, const std::vector<Fit>& fits) {
  if (const Html chart = agreement_chart(of_outages(run), "duration of the outage, s"); !chart.empty()) {
    return element("h3", text("Error over predicted sd, after GNSS outages")) + chart +
           paragraph(
               "One: the filter knows how wrong it is. Above: it trusts the sensor "
               "too much. A point for each S-IMU.",
               "note");
  }
  const Html chart = agreement_chart(of_models(run, fits), "time scale τ, s");
  if (chart.empty()) return {};
  return element("h3", text("Measured error over the model's, by time scale")) + chart +
         paragraph(
             "One: the noise model is right at that scale. Above: the sensor is worse. Points of all axes "
             "and regimes with their 95 % intervals.",
             "note");
}

}  // namespace

Html summary_section(const RunFiles& run, const std::vector<Fit>& fits) {
  Html section = heading("in-short", "In short");
  section += findings_block(run) + tiles(run, fits);
  const Html sheet = data_sheet_table(run, fits);
  Html left = drawing(run) + agreement(run, fits);
  Html right = sheet.empty() ? Html{} : element("h3", text("Noise: measured against the data sheet")) + sheet;
  if (!left.empty() || !right.empty())
    section += element("div", element("div", left) + element("div", right), "two");
  section +=
      element("div", element("h3", text("What to do next")) + list_of(next_steps(run, fits)), "answer next");
  section += paragraph(
      fmt::format(
          "Usable means: an sd of at most {:g} deg for the boresight, {:g} mm for the lever arm and {:g} ms "
          "for the time offset, so that what is left disturbs the error signals less than an automotive MEMS "
          "sensor's own noise in a roundabout.",
          kUsableBoresightSd_rad * kDegPerRad, kUsableLeverArmSd_m * kMmPerM,
          kUsableTimeOffsetSd_s * kMsPerS),
      "note");
  return section;
}

}  // namespace imuscope::report
