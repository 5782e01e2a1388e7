#include "models/noise/loose_rates.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "models/noise/chi_squared.h"
#include "models/noise/nnls.h"
#include "models/noise/parameter_scale.h"
#include "models/noise/separable_fit.h"

namespace imuscope::noise {
namespace {

/// Of a parameter's variance that goes with one loose rate: below it the sd is right to a twentieth.
constexpr double kShareOfVariance = 0.1;
/// Rates that are tried, evenly over the logarithm of those that the levels can tell apart.
constexpr int kTriedRates = 40;

/// G-43: places of the rates of Gauss-Markov processes whose logarithms are determined, but badly.
std::vector<std::size_t> loose_rates(const Model& model, const ParameterCovariance& parameters) {
  const auto places = parameter_places(model);
  std::vector<std::size_t> out;
  for (std::size_t p = 0; p < places.size(); ++p) {
    if (places[p].shape < 0 || !parameters.determined[p]) continue;
    if (model.components[places[p].component].kind != ProcessKind::kGaussMarkov) continue;
    const auto i = static_cast<Eigen::Index>(p);
    if (std::sqrt(parameters.covariance(i, i)) > kLooseLogSd) out.push_back(p);
  }
  return out;
}

/// G-43: whether a parameter owes enough of its variance to that rate.
bool leans(const ParameterCovariance& parameters, std::size_t p, std::size_t rate) {
  const auto i = static_cast<Eigen::Index>(p);
  const auto r = static_cast<Eigen::Index>(rate);
  const Eigen::MatrixXd& c = parameters.covariance;
  return c(i, r) * c(i, r) > kShareOfVariance * c(i, i) * c(r, r);
}

/// Least squares of the amplitudes at one rate, as a parabola in one of them with the others at their best.
struct Parabola {
  double least = std::numeric_limits<double>::infinity();  ///< over amplitudes that are not negative
  double lowest = 0.0;                                     ///< where the amplitude may be negative
  double at = 0.0;                                         ///< amplitude there
  double variance = 0.0;
};

class Profile {
 public:
  Profile(const FitResult& result, const Eigen::MatrixXd& whitener)
      : model_(result.model), whitener_(whitener) {
    Eigen::VectorXd y(whitener.cols());
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      const FittedLevel& level = result.wv[static_cast<std::size_t>(i)];
      levels_.push_back(level.observed.level);
      y[i] = level.observed.value;
    }
    y_ = whitener * y;
  }

  /// @param component  whose amplitude it is
  /// @param loose      process that has the rate of coordinate `at`
  [[nodiscard]] Parabola parabola(std::size_t component, std::size_t loose, double at) const {
    Model model = model_;
    Component& moved = model.components[loose];
    moved.shape[0] = shape_of_coordinate(moved.kind, at);
    Design columns(y_.size(), static_cast<Eigen::Index>(model.components.size()));
    std::vector<Eigen::Index> present;
    double scale = 1.0;
    for (std::size_t c = 0; c < model.components.size(); ++c) {
      const Component& each = model.components[c];
      Eigen::VectorXd curve(whitener_.cols());
      for (Eigen::Index i = 0; i < curve.size(); ++i)
        curve[i] = unit_wv(each.kind, each.shape, levels_[static_cast<std::size_t>(i)]).value;
      const Eigen::VectorXd column = whitener_ * curve;
      columns.col(static_cast<Eigen::Index>(c)) = column / scale_of(column);
      if (c == component) scale = scale_of(column);
      if (each.amplitude > 0.0) present.push_back(static_cast<Eigen::Index>(c));
    }
    const Design used = columns(Eigen::all, present);
    const ColumnVector found = nnls(used, y_);
    Parabola out;
    out.least = (y_ - used * found).squaredNorm();
    // Beside it those that are not zero there.
    std::vector<Eigen::Index> free{static_cast<Eigen::Index>(component)};
    for (std::size_t k = 0; k < present.size(); ++k) {
      if (found[static_cast<Eigen::Index>(k)] > 0.0 && present[k] != free.front()) free.push_back(present[k]);
    }
    const Eigen::MatrixXd d = columns(Eigen::all, free);
    const Eigen::LDLT<Eigen::MatrixXd> normal(d.transpose() * d);
    const Eigen::VectorXd x = normal.solve(d.transpose() * y_);
    out.lowest = (y_ - d * x).squaredNorm();
    out.at = x[0] / scale;
    out.variance = normal.solve(Eigen::VectorXd::Unit(d.cols(), 0))[0] / (scale * scale);
    return out;
  }

  [[nodiscard]] CoordinateRange rates() const {
    return coordinate_range(ProcessKind::kGaussMarkov, 0, levels_.back());
  }

 private:
  static double scale_of(const Eigen::VectorXd& column) { return std::max(column.norm(), 1e-300); }

  Model model_;
  const Eigen::MatrixXd& whitener_;
  std::vector<int> levels_;
  RowVector y_;
};

struct Ends {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
};

/// G-43: what all parabolas allow that come within `critical` of the least of all.
Ends ends_of(const std::vector<Parabola>& parabolas, double critical) {
  double least = std::numeric_limits<double>::infinity();
  for (const Parabola& p : parabolas) least = std::min(least, p.least);
  Ends out;
  for (const Parabola& p : parabolas) {
    const double square = (least + critical - p.lowest) * p.variance;
    if (p.least > least + critical || !(square >= 0.0)) continue;
    out.low = std::min(out.low, p.at - std::sqrt(square));
    out.high = std::max(out.high, p.at + std::sqrt(square));
  }
  return out;
}

}  // namespace

std::vector<bool> leaning_on_loose_rates(const Model& model, const ParameterCovariance& parameters) {
  const auto places = parameter_places(model);
  std::vector<bool> out(places.size(), false);
  for (const std::size_t rate : loose_rates(model, parameters)) {
    for (std::size_t p = 0; p < places.size(); ++p) {
      if (!parameters.determined[p] || places[p].component == places[rate].component) continue;
      if (leans(parameters, p, rate)) out[p] = true;
    }
  }
  return out;
}

// G-43
void profile_loose_rates(FitResult& result, const ParameterCovariance& parameters,
                         const Eigen::MatrixXd& whitener) {
  const auto places = parameter_places(result.model);
  const double two_sided = chi_squared_quantile(1.0, result.confidence);
  const double one_sided = chi_squared_quantile(1.0, 2.0 * result.confidence - 1.0);
  const std::vector<bool> leaning = leaning_on_loose_rates(result.model, parameters);
  std::optional<Profile> profile;
  for (std::size_t p = 0; p < places.size(); ++p) {
    ParameterEstimate& parameter = result.parameters[p];
    if (!leaning[p] || places[p].shape >= 0 || !parameter.ci_low || !parameter.ci_high) continue;
    if (parameter.log_sd.value_or(kLooseLogSd) >= kLooseLogSd) continue;
    if (!profile) profile.emplace(result, whitener);
    std::vector<Parabola> parabolas;
    for (const std::size_t rate : loose_rates(result.model, parameters)) {
      const std::size_t loose = places[rate].component;
      if (loose == places[p].component || !leans(parameters, p, rate)) continue;
      const Component& c = result.model.components[loose];
      parabolas.push_back(
          profile->parabola(places[p].component, loose, coordinate_of_shape(c.kind, c.shape[0])));
      const CoordinateRange range = profile->rates();
      for (int k = 0; k <= kTriedRates; ++k) {
        const double share = static_cast<double>(k) / kTriedRates;
        parabolas.push_back(
            profile->parabola(places[p].component, loose, range.low + share * (range.high - range.low)));
      }
    }
    const ParameterScale scale = parameter_scale_of(parameter.name);
    const auto shown = [&](double amplitude) { return from_scale(scale, std::log(amplitude)); };
    const Ends ends = ends_of(parabolas, two_sided);
    if (ends.low > 0.0) {
      parameter.ci_low = shown(ends.low);
      parameter.ci_high = shown(ends.high);
    } else {
      parameter.ci_low.reset();
      parameter.ci_high = shown(ends_of(parabolas, one_sided).high);
    }
  }
}

}  // namespace imuscope::noise
