#include "models/noise/nested_effects.h"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

#include "models/noise/chi_squared.h"
#include "models/noise/spread_solver.h"

namespace imuscope::noise {
namespace {

constexpr double kConfidence = 0.95;
constexpr double kTail = 0.5 * (1.0 - kConfidence);
/// Share of all units that a tolerance interval holds.
constexpr double kContent = 0.95;
/// Degrees of freedom of what is known: Student's t with so many is a normal distribution.
constexpr double kKnownDof = 1e6;
/// Below this share of its square a covariate does not change within the units.
constexpr double kNoChange = 1e-12;
/// Values of the variance between drives over which the rest is averaged, each with the same probability.
constexpr int kDriveVariances = 32;
/// Values of the variance between units for each of them, in equal steps of the logarithm of what drives and
/// errors add to it.
constexpr int kUnitVariances = 96;
/// Values of the mean for each of those, each with the same probability.
constexpr int kMeans = 16;
/// What lies beyond the last value of a variance.
constexpr double kBeyond = 2e-4;

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

/// The drives' values at one variance between drives: what is left of them within the units, and the units'
/// means.
struct Within {
  double q = 0.0;       ///< weighted sum of squares within the units, covariates taken out
  double q_fall = 0.0;  ///< by a unit of the variance between drives
  Vector slopes;        ///< of the covariates
  Matrix slope_covariance;
  Vector means;      ///< of the units, at the covariates' overall mean
  Vector variances;  ///< of these
  Vector weights;    ///< of the units: sums over their drives
};

/// The values and which of their covariates can be told.
class Drives {
 public:
  explicit Drives(std::span<const DriveValue> values) : values_(values) {
    for (const DriveValue& value : values) units_ = std::max(units_, value.unit + 1);
    counts_.assign(units_, 0);
    for (const DriveValue& value : values) ++counts_[value.unit];
    first_variance_ = 0.0;
    for (const DriveValue& value : values) first_variance_ = std::max(first_variance_, value.variance);
    choose_covariates();
  }

  [[nodiscard]] std::size_t units() const { return units_; }
  [[nodiscard]] std::size_t size() const { return values_.size(); }
  [[nodiscard]] std::size_t count(std::size_t unit) const { return counts_[unit]; }
  [[nodiscard]] double first_variance() const { return first_variance_; }
  [[nodiscard]] std::size_t covariates() const {
    return values_.empty() ? 0 : values_.front().covariates.size();
  }
  [[nodiscard]] const std::vector<std::size_t>& used() const { return used_; }
  [[nodiscard]] double covariate(std::size_t j, std::size_t i) const {
    return values_[j].covariates[used_[i]] - centre_(static_cast<Eigen::Index>(i));
  }
  /// Degrees of freedom within the units.
  [[nodiscard]] double dof() const {
    return static_cast<double>(size()) - static_cast<double>(units_) - static_cast<double>(used_.size());
  }

  /// G-70: sum of squares within the units, and slopes; G-71: the units' means and their variances.
  [[nodiscard]] Within at(double between_drives) const {
    const auto p = static_cast<Eigen::Index>(used_.size());
    const auto n_units = static_cast<Eigen::Index>(units_);
    Within out;
    out.weights = Vector::Zero(n_units);
    out.means = Vector::Zero(n_units);
    Matrix x_means = Matrix::Zero(n_units, p);
    for (std::size_t j = 0; j < size(); ++j) {
      const auto u = static_cast<Eigen::Index>(values_[j].unit);
      const double w = 1.0 / (values_[j].variance + between_drives);
      out.weights(u) += w;
      out.means(u) += w * values_[j].value;
      for (Eigen::Index i = 0; i < p; ++i) x_means(u, i) += w * covariate(j, static_cast<std::size_t>(i));
    }
    out.means.array() /= out.weights.array();
    for (Eigen::Index i = 0; i < p; ++i) x_means.col(i).array() /= out.weights.array();
    Matrix gram = Matrix::Zero(p, p);
    Vector moment = Vector::Zero(p);
    double squares = 0.0;
    Vector x(p);
    for (std::size_t j = 0; j < size(); ++j) {
      const auto u = static_cast<Eigen::Index>(values_[j].unit);
      const double w = 1.0 / (values_[j].variance + between_drives);
      const double y = values_[j].value - out.means(u);
      squares += w * y * y;
      if (p == 0) continue;
      for (Eigen::Index i = 0; i < p; ++i) x(i) = covariate(j, static_cast<std::size_t>(i)) - x_means(u, i);
      gram.noalias() += w * x * x.transpose();
      moment.noalias() += w * y * x;
    }
    out.variances = out.weights.cwiseInverse();
    out.slope_covariance = p > 0 ? Matrix(gram.ldlt().solve(Matrix::Identity(p, p))) : Matrix(0, 0);
    out.slopes = p > 0 ? Vector(out.slope_covariance * moment) : Vector(0);
    out.q = std::max(0.0, squares - (p > 0 ? out.slopes.dot(moment) : 0.0));
    // Means and slopes make the sum least, so that it follows the weights alone.
    for (std::size_t j = 0; j < size(); ++j) {
      const double w = 1.0 / (values_[j].variance + between_drives);
      const auto u = static_cast<Eigen::Index>(values_[j].unit);
      double y = values_[j].value - out.means(u);
      for (Eigen::Index i = 0; i < p; ++i)
        y -= out.slopes(i) * (covariate(j, static_cast<std::size_t>(i)) - x_means(u, i));
      out.q_fall += w * w * y * y;
    }
    if (p > 0) {
      out.means -= x_means * out.slopes;
      // What is not known of the slopes moves a unit by as much as it was measured elsewhere.
      for (Eigen::Index u = 0; u < n_units; ++u)
        out.variances(u) += x_means.row(u) * out.slope_covariance * x_means.row(u).transpose();
    }
    return out;
  }

  /// G-70: the variance between drives at which the sum of squares is `q`.
  [[nodiscard]] double variance(double q) const {
    const auto fast = variance_by_newton(
        [&](double between) {
          const Within within = at(between);
          return SumOfSquares{within.q, within.q_fall};
        },
        q);
    return fast ? *fast : variance_at([&](double between) { return at(between).q; }, q, first_variance_);
  }

 private:
  void choose_covariates() {
    const std::size_t p = covariates();
    std::vector<double> means(units_, 0.0);
    for (std::size_t i = 0; i < p; ++i) {
      std::fill(means.begin(), means.end(), 0.0);
      double centre = 0.0;
      for (const DriveValue& value : values_) {
        means[value.unit] += value.covariates[i] / static_cast<double>(counts_[value.unit]);
        centre += value.covariates[i] / static_cast<double>(size());
      }
      double change = 0.0;
      double size_of = 0.0;
      for (const DriveValue& value : values_) {
        const double d = value.covariates[i] - means[value.unit];
        change += d * d;
        size_of += value.covariates[i] * value.covariates[i];
      }
      const double left = static_cast<double>(size()) - static_cast<double>(units_ + used_.size()) - 1.0;
      if (change <= kNoChange * size_of || left < 1.0) continue;
      used_.push_back(i);
      centre_.conservativeResize(static_cast<Eigen::Index>(used_.size()));
      centre_(static_cast<Eigen::Index>(used_.size()) - 1) = centre;
    }
  }

  std::span<const DriveValue> values_;
  std::size_t units_ = 0;
  std::vector<std::size_t> counts_;
  double first_variance_ = 0.0;
  std::vector<std::size_t> used_;
  Vector centre_;
};

/// G-71: units weighted by one value of the variance between them.
struct Between {
  double mean = 0.0;
  double weight = 0.0;
  double q = 0.0;
};

Between between_units(const Within& within, double between) {
  Between out;
  double square = 0.0;
  for (Eigen::Index u = 0; u < within.means.size(); ++u) {
    const double w = 1.0 / (within.variances(u) + between);
    out.weight += w;
    out.mean += w * within.means(u);
  }
  out.mean /= out.weight;
  for (Eigen::Index u = 0; u < within.means.size(); ++u) {
    const double d = within.means(u) - out.mean;
    square += d * d / (within.variances(u) + between);
  }
  out.q = square;
  return out;
}

/// G-71: the variance between units at which their sum of squares is `q`.
double unit_variance(const Within& within, double q) {
  return variance_at([&](double between) { return between_units(within, between).q; }, q,
                     within.variances.maxCoeff());
}

/// One possible truth, with its probability: a variance between units, and the mean that goes with it.
struct Possible {
  double weight = 0.0;
  double unit_variance = 0.0;
  double mean = 0.0;
  double mean_sd = 0.0;
};

/// The distribution of what the truth may be: the sums of squares are chi-squared at the true variances, so
/// that every value of a sum that chance may give belongs to one of the variance (G-72).
std::vector<Possible> possible_truths(const Drives& drives, double drive_dof) {
  std::vector<Possible> out;
  const int n_drive = drive_dof > 0.0 ? kDriveVariances : 1;
  const auto unit_dof = static_cast<double>(drives.units() - 1);
  const boost::math::chi_squared chi2(unit_dof);
  for (int k = 0; k < n_drive; ++k) {
    double between_drives = 0.0;
    if (drive_dof > 0.0)
      between_drives =
          drives.variance(chi_squared_quantile(drive_dof, (k + 0.5) / static_cast<double>(n_drive)));
    const Within within = drives.at(between_drives);
    const double highest = unit_variance(within, boost::math::quantile(chi2, kBeyond));
    const auto share_below = [&](double variance) {
      return boost::math::cdf(boost::math::complement(chi2, between_units(within, variance).q));
    };
    const auto add = [&](double weight, double variance) {
      if (weight <= 0.0) return;
      const Between at = between_units(within, variance);
      out.push_back({weight / n_drive, variance, at.mean, std::sqrt(1.0 / at.weight)});
    };
    double below = share_below(0.0);
    add(below, 0.0);
    // In steps of the variance of a unit's mean, which the errors alone bound from below.
    const double floor = within.variances.minCoeff();
    const double step = std::log((highest + floor) / floor) / kUnitVariances;
    for (int i = 1; i <= kUnitVariances && step > 0.0; ++i) {
      const double end = floor * std::exp(step * i) - floor;
      const double share = i == kUnitVariances ? 1.0 : share_below(end);
      add(share - below, floor * std::exp(step * (i - 0.5)) - floor);
      below = std::max(below, share);
    }
  }
  return out;
}

/// The value below which a share of the possible truths lies, by bisection.
template <typename Share>
double quantile_of(const Share& share_below, double share, double low, double high) {
  constexpr int kRounds = 60;
  for (int i = 0; i < kRounds; ++i) {
    const double middle = 0.5 * (low + high);
    (share_below(middle) < share ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double normal_below(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

/// G-72: quantiles of the mean.
Spread95 mean_of(const std::vector<Possible>& truths, double mean) {
  Spread95 out;
  out.value = mean;
  double reach = 0.0;
  constexpr double kFar = 12.0;
  for (const Possible& truth : truths)
    reach = std::max(reach, std::abs(truth.mean - mean) + kFar * truth.mean_sd);
  const auto share = [&](double x) {
    double below = 0.0;
    for (const Possible& truth : truths)
      below += truth.weight * normal_below((x - truth.mean) / truth.mean_sd);
    return below;
  };
  out.low = quantile_of(share, kTail, mean - reach, mean + reach);
  out.high = quantile_of(share, 1.0 - kTail, mean - reach, mean + reach);
  return out;
}

/// G-72: quantiles of the spread between units.
Spread95 unit_sd_of(std::vector<Possible> truths, double variance) {
  std::sort(truths.begin(), truths.end(),
            [](const Possible& a, const Possible& b) { return a.unit_variance < b.unit_variance; });
  const auto at = [&](double share) {
    double below = 0.0;
    for (const Possible& truth : truths) {
      below += truth.weight;
      if (below >= share) return std::sqrt(truth.unit_variance);
    }
    return std::sqrt(truths.back().unit_variance);
  };
  return {std::sqrt(variance), at(kTail), at(1.0 - kTail)};
}

/// Half the width about a centre that holds kContent of a normal distribution of sd 1 whose mean is so far
/// from it.
double width_at(double off) {
  double low = 0.0;
  double high = off + boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + kContent));
  constexpr int kRounds = 50;
  for (int i = 0; i < kRounds; ++i) {
    const double middle = 0.5 * (low + high);
    (normal_below(middle - off) - normal_below(-middle - off) < kContent ? low : high) = middle;
  }
  return high;
}

/// The same of units with this mean and sd, from a table: it is asked for a hundred thousand times a
/// quantity.
double half_width(double centre, double mean, double sd) {
  constexpr double kStep = 0.01;
  constexpr std::size_t kSteps = 600;
  static const std::vector<double> kWidths = [] {
    std::vector<double> widths;
    for (std::size_t i = 0; i <= kSteps; ++i) widths.push_back(width_at(kStep * static_cast<double>(i)));
    return widths;
  }();
  const double off = std::abs(mean - centre);
  if (sd <= 0.0) return off;
  const double place = off / sd / kStep;
  if (place >= static_cast<double>(kSteps)) {
    // So far out, all that is missing is missing on one side.
    static const double kOneSide = boost::math::quantile(boost::math::normal(), kContent);
    return off + kOneSide * sd;
  }
  const auto at = static_cast<std::size_t>(place);
  const double share = place - static_cast<double>(at);
  return sd * ((1.0 - share) * kWidths[at] + share * kWidths[at + 1]);
}

/// G-73: the half width that is wide enough in kConfidence of the possible truths.
double tolerance_of(const std::vector<Possible>& truths, double centre) {
  std::vector<std::pair<double, double>> widths;  // and their weights
  widths.reserve(truths.size() * kMeans);
  static const std::vector<double> kSteps = [] {
    std::vector<double> steps;
    for (int i = 0; i < kMeans; ++i)
      steps.push_back(boost::math::quantile(boost::math::normal(), (i + 0.5) / kMeans));
    return steps;
  }();
  for (const Possible& truth : truths) {
    const double sd = std::sqrt(truth.unit_variance);
    for (const double step : kSteps)
      widths.emplace_back(half_width(centre, truth.mean + step * truth.mean_sd, sd), truth.weight / kMeans);
  }
  std::sort(widths.begin(), widths.end());
  double below = 0.0;
  for (const auto& [width, weight] : widths) {
    below += weight;
    if (below >= kConfidence) return width;
  }
  return widths.back().first;
}

/// G-74: of a residual in sd that were estimated together with it from `dof` degrees of freedom.
Deviation deviation_of(double deviation, double r, double dof, bool known) {
  Deviation out;
  out.deviation = deviation;
  if (known) {
    out.t = r;
    out.dof = kKnownDof;
  } else {
    // The same by the spread of the others alone: the studentized deleted residual.
    const double rest = std::max(dof - r * r, std::numeric_limits<double>::min());
    out.t = r * std::sqrt((dof - 1.0) / rest);
    out.dof = dof - 1.0;
  }
  out.p_value =
      2.0 * boost::math::cdf(boost::math::complement(boost::math::students_t(out.dof), std::abs(out.t)));
  return out;
}

/// A share of the weight that leaves nothing to be held against.
constexpr double kAllOfIt = 1.0 - 1e-9;

/// G-74: units.
void judge_units(const Within& within, const Between& between, double variance, double dof,
                 NestedEffects& out) {
  for (Eigen::Index u = 0; u < within.means.size(); ++u) {
    UnitEffect& unit = out.of_units[static_cast<std::size_t>(u)];
    const double total = within.variances(u) + variance;
    const double share = 1.0 / total / between.weight;
    if (dof < 2.0 || share > kAllOfIt) continue;
    const double d = within.means(u) - between.mean;
    unit.out = deviation_of(d / (1.0 - share), d / std::sqrt(total * (1.0 - share)), dof, variance <= 0.0);
  }
}

/// G-74: drives.
void judge_drives(std::span<const DriveValue> values, const Drives& drives, const Within& within,
                  double variance, double dof, NestedEffects& out) {
  for (std::size_t j = 0; j < values.size(); ++j) {
    const auto u = static_cast<Eigen::Index>(values[j].unit);
    const double total = values[j].variance + variance;
    const double share = 1.0 / total / within.weights(u);
    if (drives.count(values[j].unit) < 2 || dof < 2.0 || share > kAllOfIt) continue;
    double d = values[j].value - within.means(u);
    for (std::size_t i = 0; i < drives.used().size(); ++i)
      d -= within.slopes(static_cast<Eigen::Index>(i)) * drives.covariate(j, i);
    out.of_drives[j] =
        deviation_of(d / (1.0 - share), d / std::sqrt(total * (1.0 - share)), dof, variance <= 0.0);
  }
}

bool is_usable(std::span<const DriveValue> values) {
  return std::all_of(values.begin(), values.end(), [](const DriveValue& value) {
    return std::isfinite(value.value) && std::isfinite(value.variance) && value.variance > 0.0;
  });
}

}  // namespace

std::optional<NestedEffects> nested_effects(std::span<const DriveValue> values) {
  if (!is_usable(values)) return std::nullopt;
  const Drives drives(values);
  if (drives.units() < 2) return std::nullopt;
  NestedEffects out;
  out.units = drives.units();
  out.drives = values.size();
  const double drive_dof = drives.dof();
  double drive_variance = 0.0;
  if (drive_dof > 0.0) {
    drive_variance = drives.variance(drive_dof);
    out.drive_sd = Spread95{std::sqrt(drive_variance),
                            std::sqrt(drives.variance(chi_squared_quantile(drive_dof, 1.0 - kTail))),
                            std::sqrt(drives.variance(chi_squared_quantile(drive_dof, kTail)))};
  }
  const Within within = drives.at(drive_variance);
  const auto unit_dof = static_cast<double>(out.units - 1);
  const double between_variance = unit_variance(within, unit_dof);
  const Between between = between_units(within, between_variance);
  const auto truths = possible_truths(drives, drive_dof);
  out.mean = mean_of(truths, between.mean);
  out.unit_sd = unit_sd_of(truths, between_variance);
  const double half = tolerance_of(truths, between.mean);
  out.tolerance_low = between.mean - half;
  out.tolerance_high = between.mean + half;
  out.slopes.assign(drives.covariates(), Slope{});
  for (std::size_t i = 0; i < drives.used().size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    out.slopes[drives.used()[i]] = {within.slopes(at), std::sqrt(within.slope_covariance(at, at))};
  }
  out.of_units.resize(out.units);
  for (std::size_t u = 0; u < out.units; ++u) {
    const auto at = static_cast<Eigen::Index>(u);
    out.of_units[u].drives = drives.count(u);
    out.of_units[u].mean = within.means(at);
    out.of_units[u].variance = within.variances(at);
  }
  out.of_drives.resize(values.size());
  judge_units(within, between, between_variance, unit_dof, out);
  judge_drives(values, drives, within, drive_variance, drive_dof, out);
  return out;
}

namespace {

/// Units of three drives and more, at times that differ.
std::vector<bool> units_with_a_line(std::span<const DriveValue> values, std::span<const double> time,
                                    std::size_t units) {
  std::vector<double> counts(units, 0.0);
  std::vector<double> means(units, 0.0);
  for (std::size_t j = 0; j < values.size(); ++j) {
    const std::size_t u = values[j].unit;
    counts[u] += 1.0;
    means[u] += (time[j] - means[u]) / counts[u];
  }
  std::vector<double> change(units, 0.0);
  std::vector<double> size_of(units, 0.0);
  for (std::size_t j = 0; j < values.size(); ++j) {
    const double d = time[j] - means[values[j].unit];
    change[values[j].unit] += d * d;
    size_of[values[j].unit] += time[j] * time[j];
  }
  std::vector<bool> out(units);
  for (std::size_t u = 0; u < units; ++u) out[u] = counts[u] >= 3.0 && change[u] > kNoChange * size_of[u];
  return out;
}

}  // namespace

// G-74: drift of each unit
std::vector<std::optional<Deviation>> unit_drifts(std::span<const DriveValue> values,
                                                  std::span<const double> time) {
  std::size_t units = 0;
  for (const DriveValue& value : values) units = std::max(units, value.unit + 1);
  std::vector<std::optional<Deviation>> out(units);
  if (!is_usable(values) || values.empty()) return out;
  const std::vector<bool> has_line = units_with_a_line(values, time, units);
  double first = 0.0;
  double dof = 0.0;
  for (const DriveValue& value : values) {
    first = std::max(first, value.variance);
    dof += has_line[value.unit] ? 1.0 : 0.0;
  }
  dof -= 2.0 * static_cast<double>(std::count(has_line.begin(), has_line.end(), true));
  if (dof < 1.0) return out;
  struct UnitLine {
    double w = 0.0, t = 0.0, y = 0.0, tt = 0.0, ty = 0.0;
  };
  std::vector<UnitLine> lines(units);
  // Sums about each unit's means at one variance between drives; what the lines leave.
  const auto left = [&](double variance) {
    lines.assign(units, UnitLine{});
    for (std::size_t j = 0; j < values.size(); ++j) {
      UnitLine& line = lines[values[j].unit];
      const double w = 1.0 / (values[j].variance + variance);
      line.w += w;
      line.t += w * time[j];
      line.y += w * values[j].value;
    }
    double squares = 0.0;
    for (std::size_t j = 0; j < values.size(); ++j) {
      if (!has_line[values[j].unit]) continue;
      UnitLine& line = lines[values[j].unit];
      const double w = 1.0 / (values[j].variance + variance);
      const double t = time[j] - line.t / line.w;
      const double y = values[j].value - line.y / line.w;
      line.tt += w * t * t;
      line.ty += w * t * y;
      squares += w * y * y;
    }
    for (const UnitLine& line : lines) squares -= line.tt > 0.0 ? line.ty * line.ty / line.tt : 0.0;
    return squares;
  };
  const double variance = variance_at(left, dof, first);
  (void)left(variance);
  for (std::size_t u = 0; u < units; ++u) {
    if (!has_line[u]) continue;
    Deviation drift;
    drift.deviation = lines[u].ty / lines[u].tt;
    drift.t = drift.deviation * std::sqrt(lines[u].tt);
    drift.dof = variance > 0.0 ? dof : kKnownDof;
    drift.p_value = 2.0 * boost::math::cdf(
                              boost::math::complement(boost::math::students_t(drift.dof), std::abs(drift.t)));
    out[u] = drift;
  }
  return out;
}

}  // namespace imuscope::noise
