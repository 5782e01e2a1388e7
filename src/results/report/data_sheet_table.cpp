#include "results/report/data_sheet_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "base/units.h"
#include "models/noise/json.h"
#include "models/noise/quantities.h"
#include "results/report/people.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::named;
using tables::number_at;
using tables::text_at;

using nlohmann::json;

/// A term of a data sheet: where it stands in run.json, and what the noise engine calls it.
struct Term {
  const char* words;
  const char* unit;
  std::string_view quantity;
  bool gyro;
  const char* sheet_key;
  double sheet_factor;  ///< from the sheet's unit to `unit`
};

/// deg/s/sqrt(Hz) to deg/sqrt(h), and m/s^2/sqrt(Hz) to m/s/sqrt(h): the root of an hour over an hour's
/// seconds.
constexpr double kRootOfHour_s = 60.0;

constexpr Term kTerms[] = {
    {"gyro random walk", "deg/√h", "angle random walk", true, "gyro_density_degps_per_sqrt_hz",
     kRootOfHour_s},
    {"gyro instability", "deg/h", "bias instability", true, "gyro_bias_stability_deg_per_h", 1.0},
    {"accel random walk", "m/s/√h", "velocity random walk", false, "accel_density_ug_per_sqrt_hz",
     kRootOfHour_s* kMps2PerMicroG},
    {"accel instability", "ug", "bias instability", false, "accel_bias_stability_ug", 1.0}};

/// What the axes of a triad have of one term.
struct Range {
  double lowest = 0.0;
  double highest = 0.0;
  std::size_t n = 0;
  std::size_t bounds = 0;  ///< of them known by a bound alone

  void add(const noise::Quantity& quantity, double factor) {
    if (quantity.knowledge == noise::Knowledge::kUnknown || !std::isfinite(quantity.value)) return;
    const double value = factor * quantity.value;
    lowest = n == 0 ? value : std::min(lowest, value);
    highest = n == 0 ? value : std::max(highest, value);
    ++n;
    if (quantity.knowledge == noise::Knowledge::kBound) ++bounds;
  }

  [[nodiscard]] Html html() const {
    constexpr int kDigits = 2;
    if (n == 0) return text("not known");
    const Html high = number(highest, kDigits);
    if (bounds == n) return text("at most ") + high;
    const Html low = number(lowest, kDigits);
    return low.str() == high.str() ? high : low + text(" to ") + high;
  }
};

/// Numbers of ug come as m/s^2 or as ug, those of deg/h as deg/h.
double unit_factor(const std::string& unit) {
  if (unit == "m/s^2") return 1.0 / kMps2PerMicroG;
  if (unit == "mg") return 1e3;
  return 1.0;
}

Range range_of(const std::vector<noise::AxisFit>& fits, const Term& term) {
  Range range;
  for (const noise::AxisFit& axis : fits) {
    if (noise::is_gyro(axis.unit) != term.gyro) continue;
    for (const noise::Quantity& quantity : noise::filter_quantities(axis.fit, axis.unit)) {
      if (quantity.name == term.quantity) range.add(quantity, unit_factor(quantity.unit));
    }
  }
  return range;
}

/// "within", "1.4 times": the worst axis over the sheet's number, in the regime that a sheet is about, rest.
/// A bound tells only where it is below.
Html comparison_cell(const Range& range, std::optional<double> sheet) {
  if (!sheet || !(*sheet > 0.0) || range.n == 0) return text(kUnknown);
  // Sheets give typical values; a unit within a tenth of them is as typical as can be told.
  constexpr double kTypical = 1.1;
  const double ratio = range.highest / *sheet;
  if (ratio <= kTypical) return element("strong", text("within"), "yes");
  if (range.bounds > 0) return text(kUnknown);
  return element("strong", text(fmt::format("{:.2g} times", ratio)), "partly");
}

}  // namespace

std::vector<noise::AxisFit> axis_fits(const RunFiles& run, const std::string& imu,
                                      const std::string& regime) {
  std::vector<noise::AxisFit> fits;
  for (const json& entry : run.models) {
    if (text_at(entry, "name") != imu || text_at(entry, "regime") != regime) continue;
    auto fit = noise::fit_from_json(entry);
    const auto unit = noise::parse_unit(text_at(entry, "unit"));
    if (fit && unit)
      fits.push_back({text_at(entry, "axis"), *unit, std::move(*fit), noise::fitted_to_words(entry)});
  }
  return fits;
}

Html random_walk_cell(const std::vector<noise::AxisFit>& fits, const std::string& axis) {
  const auto of_axis =
      std::find_if(fits.begin(), fits.end(), [&](const noise::AxisFit& fit) { return fit.axis == axis; });
  if (of_axis == fits.end()) return text(kUnknown);
  for (const noise::Quantity& quantity : noise::filter_quantities(of_axis->fit, of_axis->unit)) {
    if (quantity.name != "angle random walk" && quantity.name != "velocity random walk") continue;
    const Html unit = text(noise::is_gyro(of_axis->unit) ? " deg/√h" : " m/s/√h");
    if (quantity.knowledge == noise::Knowledge::kUnknown) return text("not known");
    if (quantity.knowledge == noise::Knowledge::kBound)
      return text("at most ") + number(quantity.value, 2) + unit;
    return with_interval(quantity.value, quantity.ci_low, quantity.ci_high) + unit;
  }
  return text(kUnknown);
}

Html data_sheet_table(const RunFiles& run, const std::vector<Fit>& fits) {
  const auto regimes = particular_regimes(regimes_of(fits));
  if (!run.models.is_array() || regimes.empty()) return {};
  std::vector<Html> headings{text("term")};
  for (const std::string& regime : regimes) headings.push_back(text(regime.empty() ? "measured" : regime));
  headings.push_back(text("maker"));
  headings.push_back(text("worst axis"));
  Table table(std::move(headings));
  for (const SImuFiles& study : run.studies) {
    std::vector<std::vector<noise::AxisFit>> by_regime;
    for (const std::string& regime : regimes) by_regime.push_back(axis_fits(run, study.name, regime));
    if (std::all_of(by_regime.begin(), by_regime.end(), [](const auto& of) { return of.empty(); })) continue;
    const json& sheet = field(named(field(run.run, "devices"), study.name), "data_sheet");
    table.add_group(text(study.name));
    for (const Term& term : kTerms) {
      std::vector<Html> row{text(term.words) + text(", ") + element("span", text(term.unit), "quiet")};
      for (const auto& of_regime : by_regime) row.push_back(range_of(of_regime, term).html());
      auto maker = number_at(sheet, term.sheet_key);
      if (maker) *maker *= term.sheet_factor;
      row.push_back(number(maker, 2));
      row.push_back(comparison_cell(range_of(by_regime.front(), term), maker));
      table.add_row(std::move(row));
    }
  }
  return table.empty() ? Html{} : element("div", table.html(), "close");
}

}  // namespace imuscope::report
