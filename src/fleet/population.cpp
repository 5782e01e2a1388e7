#include "fleet/population.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "models/noise/holm.h"

namespace imuscope::fleet {
namespace {

constexpr double kDaysPerYear = 365.25;
/// Less than that between the first drive and the last tells no drift.
constexpr double kDriftSpan_days = 30.0;
/// Less than that between the coldest drive and the hottest tells nothing about temperature.
constexpr double kTemperatureSpan_degC = 5.0;
/// What a unit is now: over so many of its newest drives.
constexpr std::size_t kNewest = 5;
constexpr double kSdOfConfidence = 1.959964;

/// "GM1 beta": a parameter of a process, not a property of the sensor.
bool is_of_process(const std::string& quantity) {
  return quantity.size() > 1 && quantity[0] >= 'A' && quantity[0] <= 'Z' && quantity[1] >= 'A' &&
         quantity[1] <= 'Z';
}

/// The quantity as the model takes it: units without gaps, covariates that all drives have.
class Rows {
 public:
  Rows(const Fleet& fleet, const Quantity& quantity) : quantity_(&quantity) {
    std::map<std::uint32_t, std::size_t> place;
    double first_day = INFINITY;
    double last_day = -INFINITY;
    double coldest = INFINITY;
    double hottest = -INFINITY;
    bool all_days = true;
    bool all_warm = true;
    for (const Measured& value : quantity.values) {
      const double day = fleet.days[value.capture];
      const double warm = fleet.temperatures_degC[value.capture][value.device];
      all_days = all_days && std::isfinite(day);
      all_warm = all_warm && std::isfinite(warm);
      first_day = std::min(first_day, day);
      last_day = std::max(last_day, day);
      coldest = std::min(coldest, warm);
      hottest = std::max(hottest, warm);
      if (place.emplace(value.unit, units_.size()).second) units_.push_back(value.unit);
    }
    has_time_ = all_days && last_day - first_day >= kDriftSpan_days;
    has_temperature_ = all_warm && hottest - coldest >= kTemperatureSpan_degC;
    for (const Measured& value : quantity.values) {
      noise::DriveValue row{place[value.unit], value.value, value.sd * value.sd, {}};
      years_.push_back(has_time_ ? (fleet.days[value.capture] - first_day) / kDaysPerYear : 0.0);
      if (has_temperature_) row.covariates.push_back(fleet.temperatures_degC[value.capture][value.device]);
      if (has_time_) row.covariates.push_back(years_.back());
      rows_.push_back(std::move(row));
    }
  }

  [[nodiscard]] const std::vector<noise::DriveValue>& rows() const { return rows_; }
  [[nodiscard]] std::uint32_t unit(std::size_t place) const { return units_[place]; }
  [[nodiscard]] std::size_t units() const { return units_.size(); }

  void judge(QuantityResult& out) const {
    out.effects = noise::nested_effects(rows_);
    if (!out.effects) return;
    std::size_t at = 0;
    if (has_temperature_) out.per_degC = slope(out.effects->slopes[at++]);
    if (has_time_) out.per_year = slope(out.effects->slopes[at]);
    if (is_of_process(quantity_->name)) return;
    const auto& of_units = out.effects->of_units;
    for (std::size_t u = 0; u < of_units.size() && !quantity_->from_first_drive; ++u) {
      if (of_units[u].out) out.outlying_units.push_back({units_[u], {}, {}, *of_units[u].out, 1.0});
    }
    std::vector<bool> pair_is_tested(units_.size(), false);
    for (std::size_t j = 0; j < rows_.size(); ++j) {
      const auto& drive = out.effects->of_drives[j];
      if (!drive) continue;
      // Two drives of a unit are one difference: it is tested once, and which of them is wrong nobody can
      // tell.
      if (of_units[rows_[j].unit].drives == 2) {
        if (pair_is_tested[rows_[j].unit]) continue;
        pair_is_tested[rows_[j].unit] = true;
      }
      const Measured& value = quantity_->values[j];
      out.outlying_drives.push_back({value.unit, value.capture, value.device, *drive, 1.0});
    }
    judge_drifts(out);
  }

 private:
  static std::optional<noise::Slope> slope(const noise::Slope& found) {
    return found.sd > 0.0 ? std::optional(found) : std::nullopt;
  }

  void judge_drifts(QuantityResult& out) const {
    if (!has_time_) return;
    auto rows = rows_;
    if (out.per_degC) {
      for (auto& row : rows) row.value -= out.per_degC->value * row.covariates.front();
    }
    const auto drifts = noise::unit_drifts(rows, years_);
    for (std::size_t u = 0; u < drifts.size(); ++u) {
      if (drifts[u]) out.drifts.push_back({units_[u], {}, {}, *drifts[u], 1.0});
    }
  }

  const Quantity* quantity_;
  std::vector<noise::DriveValue> rows_;
  std::vector<std::uint32_t> units_;
  std::vector<double> years_;
  bool has_time_ = false;
  bool has_temperature_ = false;
};

/// What a unit is now: its newest drives, weighted by their errors and by what its drives differ by.
struct Now {
  double value = 0.0;
  double variance = 0.0;
};

std::optional<Now> now_of(const Fleet& fleet, const Quantity& quantity, std::uint32_t unit,
                          double drive_variance) {
  std::vector<const Measured*> mine;
  for (const Measured& value : quantity.values) {
    if (value.unit == unit) mine.push_back(&value);
  }
  if (mine.empty()) return std::nullopt;
  std::stable_sort(mine.begin(), mine.end(), [&](const Measured* a, const Measured* b) {
    return fleet.days[a->capture] > fleet.days[b->capture];
  });
  double weight = 0.0;
  Now now;
  for (std::size_t i = 0; i < std::min(mine.size(), kNewest); ++i) {
    const double w = 1.0 / (mine[i]->sd * mine[i]->sd + drive_variance);
    weight += w;
    now.value += w * mine[i]->value;
  }
  now.value /= weight;
  now.variance = 1.0 / weight;
  return now;
}

void judge_holding(const Fleet& fleet, const Quantity& quantity, QuantityResult& out) {
  double drive_variance = 0.0;
  if (out.effects && out.effects->drive_sd)
    drive_variance = out.effects->drive_sd->value * out.effects->drive_sd->value;
  for (const Stated& stated : quantity.stated) {
    const auto now = now_of(fleet, quantity, stated.unit, drive_variance);
    if (!now) continue;
    const double d = now->value - stated.value;
    const double sd = std::sqrt(now->variance + stated.sd * stated.sd);
    const double above = (d - std::log(fleet.certificate_factor)) / sd;
    out.holdings.push_back({stated.unit, stated.against, std::exp(stated.value), std::exp(d),
                            std::exp(d - kSdOfConfidence * sd), std::exp(d + kSdOfConfidence * sd),
                            0.5 * std::erfc(above / std::sqrt(2.0)), 1.0});
  }
}

/// Corrects the p-values of one kind over all quantities.
template <typename List>
void correct(std::vector<QuantityResult>& results, List list) {
  std::vector<std::optional<double>> p;
  for (auto& result : results)
    for (auto& test : list(result)) p.emplace_back(test.test.p_value);
  const auto adjusted = noise::holm_adjusted(p);
  std::size_t at = 0;
  for (auto& result : results)
    for (auto& test : list(result)) test.p_corrected = adjusted[at++].value_or(1.0);
}

}  // namespace

const char* words_of(const Holding& holding, double factor) {
  if (holding.p_corrected < noise::kSignificance) return "no";
  return holding.ratio_high <= factor ? "yes" : "cannot tell";
}

std::vector<QuantityResult> population_of(const Fleet& fleet) {
  std::vector<QuantityResult> results(fleet.quantities.size());
  tbb::parallel_for(std::size_t{0}, results.size(), [&](std::size_t i) {
    const Rows rows(fleet, fleet.quantities[i]);
    rows.judge(results[i]);
    judge_holding(fleet, fleet.quantities[i], results[i]);
  });
  correct(
      results, [](QuantityResult & result) -> auto& { return result.outlying_units; });
  correct(
      results, [](QuantityResult & result) -> auto& { return result.outlying_drives; });
  correct(
      results, [](QuantityResult & result) -> auto& { return result.drifts; });
  std::vector<std::optional<double>> p;
  for (const auto& result : results)
    for (const auto& holding : result.holdings) p.emplace_back(holding.p_value);
  const auto adjusted = noise::holm_adjusted(p);
  std::size_t at = 0;
  for (auto& result : results)
    for (auto& holding : result.holdings) holding.p_corrected = adjusted[at++].value_or(1.0);
  return results;
}

}  // namespace imuscope::fleet
