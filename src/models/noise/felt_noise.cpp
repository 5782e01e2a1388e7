#include "models/noise/felt_noise.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <functional>
#include <limits>

#include "models/noise/chi_squared.h"
#include "models/noise/filter_form.h"
#include "models/noise/inference.h"
#include "models/noise/parameter_scale.h"
#include "models/noise/power_law.h"
#include "models/noise/separable_fit.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

using OfModel = std::function<double(const Model&)>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Times of the band at which growths are compared.
constexpr int kBandPoints = 50;
/// A process of so many samples' memory can be told from white noise, and takes a bias' place.
constexpr double kBiasSamples = 10.0;
/// Longest correlation time in the place of a random walk, in lengths of the band: over the band it is one.
constexpr double kLongestTau = 10.0;
/// A logarithm with a larger sd is not determined (as for the fit's own parameters).
constexpr double kUndetermined = 1.5;
/// Share of the slow terms' growth below which a term does not count.
constexpr double kNegligibleShare = 0.01;
constexpr double kNegligibleUntold = 0.2;  ///< of one that the data do not tell

/// A Gauss-Markov process of at most 1/kEdge times the time at which noise is asked for is white to it, one
/// of kEdge times that time is not.
constexpr double kEdge = 2.0;

/// Share of a process that is white at `fast_s` (G-28): it moves without a step as a time constant crosses
/// it.
double white_share(const Component& c, double rate_hz, double fast_s) {
  switch (c.kind) {
    case ProcessKind::kRandomWalk:
    case ProcessKind::kRamp:
    case ProcessKind::kFlicker:
    case ProcessKind::kPowerLaw:
      return 0.0;
    case ProcessKind::kGaussMarkov: {
      const double in_edges = -std::log(c.shape[0] * rate_hz * fast_s) / std::log(kEdge);
      const double x = std::clamp(0.5 * (1.0 + in_edges), 0.0, 1.0);
      return 1.0 - x * x * (3.0 - 2.0 * x);
    }
    default:
      return 1.0;
  }
}

/// Less than half of it is white.
bool is_slow(const Component& c, double rate_hz, double fast_s) {
  return white_share(c, rate_hz, fast_s) < 0.5;
}

/// G-28.
double white_of(const Model& model, double rate_hz, double fast_s) {
  double sum = 0.0;
  for (const Component& c : without_power_laws(model).components)
    sum += white_share(c, rate_hz, fast_s) * low_frequency_variance(c) / rate_hz;
  return sum;
}

/// Variance of what a process grows by in `time_s`.
double growth_of(const Component& c, double rate_hz, double time_s) {
  const double samples = time_s * rate_hz;
  switch (c.kind) {
    case ProcessKind::kRandomWalk:
      return c.amplitude * samples;
    case ProcessKind::kRamp:
      return c.amplitude * samples * samples;
    case ProcessKind::kGaussMarkov:
      return -2.0 * c.amplitude * std::expm1(-c.shape[0] * samples);
    default:
      return 0.0;
  }
}

/// What of a model is slow at `fast_s`.
class SlowPart {
 public:
  SlowPart(const Model& model, double rate_hz, double fast_s)
      : terms_(without_power_laws(model).components), rate_hz_(rate_hz) {
    for (const Component& c : terms_) shares_.push_back(1.0 - white_share(c, rate_hz, fast_s));
  }

  /// G-29.
  [[nodiscard]] double growth(double time_s) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < terms_.size(); ++i)
      sum += shares_[i] * growth_of(terms_[i], rate_hz_, time_s);
    return sum;
  }

 private:
  std::vector<Component> terms_;
  std::vector<double> shares_;
  double rate_hz_;
};

/// The middle of part `i` of kBandPoints parts that are alike in the logarithm.
double band_time_s(const FilterBand& band, int i) {
  return band.from_s * std::pow(band.to_s / band.from_s, (i + 0.5) / kBandPoints);
}

/// Mean over the band, on a logarithmic scale of time, of ln(growth / unit growth).
template <typename Unit>
double mean_log_growth(const SlowPart& slow, const FilterBand& band, Unit&& unit) {
  double sum = 0.0;
  for (int i = 0; i < kBandPoints; ++i) {
    const double time_s = band_time_s(band, i);
    sum += std::log(slow.growth(time_s) / unit(time_s));
  }
  return sum / kBandPoints;
}

double gauss_markov_growth(double tau_s, double time_s) { return -2.0 * std::expm1(-time_s / tau_s); }

/// G-30.
double walk_of(const SlowPart& slow, const FilterBand& band) {
  return std::exp(mean_log_growth(slow, band, [](double t) { return t; }));
}

/// G-31.
double bias_variance_of(const SlowPart& slow, const FilterBand& band, double tau_s) {
  return std::exp(mean_log_growth(slow, band, [&](double t) { return gauss_markov_growth(tau_s, t); }));
}

/// The correlation time with which one Gauss-Markov process follows the slow terms' growth best: the logarithm of
/// what one is of the other varies least over the band.
double best_tau(const SlowPart& slow, const FilterBand& band) {
  constexpr int kSteps = 200;
  std::array<double, kBandPoints> times_s{};
  std::array<double, kBandPoints> growths{};
  for (int k = 0; k < kBandPoints; ++k) {
    const auto at = static_cast<std::size_t>(k);
    times_s[at] = band_time_s(band, k);
    growths[at] = slow.growth(times_s[at]);
  }
  double best = band.to_s;
  double least = kInfinity;
  for (int i = 0; i <= kSteps; ++i) {
    const double tau_s =
        band.from_s * std::pow(kLongestTau * band.to_s / band.from_s, i / static_cast<double>(kSteps));
    std::array<double, kBandPoints> logs{};
    double level = 0.0;
    for (std::size_t k = 0; k < logs.size(); ++k) {
      logs[k] = std::log(growths[k] / gauss_markov_growth(tau_s, times_s[k]));
      level += logs[k] / kBandPoints;
    }
    double squares = 0.0;
    for (const double log : logs) squares += (log - level) * (log - level);
    if (squares < least) {
      least = squares;
      best = tau_s;
    }
  }
  return best;
}

/// Degrees of freedom of a level's value (G-2), fewer where the estimator is less efficient.
double freedom_of(const WvLevel& level, double efficiency) {
  return std::max(efficiency * static_cast<double>(level.n_coefficients) / level.tau_samples, 1.0);
}

/// The sd of functions of a fit's parameters, by their gradient and the covariance of the wavelet variance
/// under the fitted model, whether or not each parameter by itself is told.
class Uncertainty {
 public:
  /// Of a logarithm.
  struct Range {
    double low = 0.0;
    double high = 0.0;
  };

  explicit Uncertainty(const FitResult& fit) : fit_(fit), places_(parameter_places(fit.model)) {
    std::vector<int> levels;
    for (const FittedLevel& level : fit.wv) levels.push_back(level.observed.level);
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (fit.model.components[places_[p].component].amplitude > 0.0) present_.push_back(p);
    }
    if (levels.empty() || present_.empty() || levels.size() < present_.size()) return;
    const Eigen::MatrixXd v = covariance(levels.size());
    const Eigen::VectorXd scale = v.diagonal().cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd relative = scale.asDiagonal() * v * scale.asDiagonal();
    constexpr double kRidge = 1e-10;
    relative.diagonal().array() += kRidge;
    const Eigen::LLT<Eigen::MatrixXd> llt(relative);
    if (llt.info() != Eigen::Success) return;
    std::vector<Eigen::Index> columns(present_.begin(), present_.end());
    const Eigen::MatrixXd all = wv_jacobian(fit.model, levels, places_);
    const Eigen::MatrixXd d =
        llt.matrixL().solve(Eigen::MatrixXd(scale.asDiagonal() * all(Eigen::all, columns)));
    const Eigen::MatrixXd information = d.transpose() * d;
    eigen_.compute(information);
    known_ = true;
  }

  /// G-32: what of ln(f(model)) - ln(f(the fit)) lies within z sds, by the likelihood's profile over each of the model's
  /// correlation times in turn, along which a share moves too far for a gradient. Empty where the data tell no such time.
  [[nodiscard]] std::optional<Range> profile(const OfModel& f, double z) const {
    if (!known_ || !(eigen_.eigenvalues().minCoeff() > 0.0)) return std::nullopt;
    Eigen::MatrixXd sigma = eigen_.eigenvectors() * eigen_.eigenvalues().cwiseInverse().asDiagonal() *
                            eigen_.eigenvectors().transpose();
    for (std::size_t i = 0; i < present_.size() && present_[i] < fit_.parameters.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      sigma(k, k) += std::pow(fit_.parameters[present_[i]].spread_sd, 2);
    }
    std::optional<Range> range;
    for (std::size_t i = 0; i < present_.size(); ++i) {
      const ParameterPlace& place = places_[present_[i]];
      const bool is_rate =
          place.shape >= 0 && fit_.model.components[place.component].kind == ProcessKind::kGaussMarkov;
      const auto k = static_cast<Eigen::Index>(i);
      if (!is_rate || !(std::sqrt(sigma(k, k)) < kUndetermined)) continue;
      widen(range, profile_over(k, sigma, f, z));
    }
    return range;
  }

  /// Sd of ln(f(model)); infinite where the data do not tell.
  [[nodiscard]] double log_sd(const OfModel& f) const {
    if (!known_) return kInfinity;
    const Eigen::VectorXd slope = gradient(f, fit_.model);
    const Eigen::VectorXd along = eigen_.eigenvectors().transpose() * slope;
    double variance = 0.0;
    for (std::size_t i = 0; i < present_.size() && present_[i] < fit_.parameters.size(); ++i)
      variance += std::pow(slope[static_cast<Eigen::Index>(i)] * fit_.parameters[present_[i]].spread_sd, 2);
    for (Eigen::Index i = 0; i < along.size(); ++i) {
      constexpr double kNothing = 1e-9;
      if (std::abs(along[i]) < kNothing) continue;
      if (!(eigen_.eigenvalues()[i] > 0.0)) return kInfinity;
      variance += along[i] * along[i] / eigen_.eigenvalues()[i];
    }
    return std::sqrt(variance);
  }

 private:
  [[nodiscard]] Eigen::MatrixXd covariance(std::size_t levels) const {
    Eigen::MatrixXd v = wv_covariance(fit_.model, observed_wv(fit_), levels);
    for (std::size_t i = 0; i < levels; ++i) {
      const double y = fit_.wv[i].observed.value;
      const double m = fit_.wv[i].fitted;
      const auto k = static_cast<Eigen::Index>(i);
      if (y + m > 0.0) v(k, k) += fit_.model_error * fit_.model_error * 2.0 * y * m * m / (y + m);  // G-15
    }
    return v;
  }

  /// The model with one present parameter's coordinate moved.
  void move(Model& model, std::size_t present, double step) const {
    const ParameterPlace& place = places_[present_[present]];
    Component& c = model.components[place.component];
    if (place.shape < 0) {
      c.amplitude *= std::exp(step);
    } else {
      double& shape = c.shape[static_cast<std::size_t>(place.shape)];
      shape = shape_of_coordinate(c.kind, coordinate_of_shape(c.kind, shape) + step);
    }
  }

  void move_all(Model& model, const Eigen::VectorXd& steps) const {
    for (std::size_t i = 0; i < present_.size(); ++i) move(model, i, steps[static_cast<Eigen::Index>(i)]);
  }

  /// Of ln(f) at a model.
  [[nodiscard]] Eigen::VectorXd gradient(const OfModel& f, const Model& model) const {
    constexpr double kStep = 1e-4;
    Eigen::VectorXd g(static_cast<Eigen::Index>(present_.size()));
    for (std::size_t i = 0; i < present_.size(); ++i) {
      const auto at = [&](double step) {
        Model moved = model;
        move(moved, i, step);
        return std::log(f(moved));
      };
      g[static_cast<Eigen::Index>(i)] = (at(kStep) - at(-kStep)) / (2.0 * kStep);
    }
    return g;
  }

  /// Of one parameter, the others following it as the data correlate them, and within what is left of z beside it.
  [[nodiscard]] Range profile_over(Eigen::Index over, const Eigen::MatrixXd& sigma, const OfModel& f,
                                   double z) const {
    constexpr int kSteps = 12;
    const double sd = std::sqrt(sigma(over, over));
    const Eigen::VectorXd along = sigma.col(over) / sd;
    const Eigen::MatrixXd beside = sigma - along * along.transpose();
    const double at_fit = std::log(f(fit_.model));
    Range range{0.0, 0.0};
    for (int step = -kSteps; step <= kSteps; ++step) {
      const double u = z * step / kSteps;
      Model model = fit_.model;
      move_all(model, u * along);
      // Where the others take it furthest.
      const Eigen::VectorXd slope = gradient(f, model);
      const Eigen::VectorXd steepest = beside * slope;
      const double length = std::sqrt(std::max(0.0, slope.dot(steepest)));
      for (const double sign : {-1.0, 1.0}) {
        Model moved = model;
        if (length > 0.0) move_all(moved, sign * std::sqrt(z * z - u * u) / length * steepest);
        const double value = std::log(f(moved)) - at_fit;
        if ((value >= range.low && value <= range.high) || !is_near(moved)) continue;
        range.low = std::min(range.low, value);
        range.high = std::max(range.high, value);
      }
    }
    return range;
  }

  /// Whether a moved model's curve is anywhere near what the record shows: beyond the logarithm that counts as
  /// undetermined, a gradient taken nearer by says nothing.
  [[nodiscard]] bool is_near(const Model& moved) const {
    if (!std::ranges::all_of(moved.components, [](const Component& c) {
          return std::isfinite(c.amplitude) && is_in_range(c.kind, c.shape);
        }))
      return false;
    return std::ranges::none_of(fit_.wv, [&](const FittedLevel& level) {
      const double highest = std::max(level.fitted, level.observed.ci_high);
      return !(model_wv(moved, level.observed.level) < std::exp(kUndetermined) * highest);
    });
  }

  static void widen(std::optional<Range>& range, const Range& other) {
    range = range ? Range{std::min(range->low, other.low), std::max(range->high, other.high)} : other;
  }

  const FitResult& fit_;
  std::vector<ParameterPlace> places_;
  std::vector<std::size_t> present_;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen_;
  bool known_ = false;
};

/// A fit and its uncertainty, which costs a covariance matrix: once for all that is asked of the fit, and not before.
class Told {
 public:
  explicit Told(const FitResult& result) : fit(result) {}

  [[nodiscard]] const Uncertainty& uncertainty() {
    if (!uncertainty_) uncertainty_.emplace(fit);
    return *uncertainty_;
  }

  const FitResult& fit;

 private:
  std::optional<Uncertainty> uncertainty_;
};

/// G-32: the most of a term with this unit curve that every level allows beside the rest of the model.
/// Infinite without a level. What the rest of a rejected model takes of a level is not known.
double most_of(const FitResult& fit, const std::function<double(int)>& unit, const Model& rest) {
  double most = kInfinity;
  const double tail = (1.0 - fit.confidence) / static_cast<double>(std::max<std::size_t>(1, fit.wv.size()));
  for (const FittedLevel& level : fit.wv) {
    const double dof = freedom_of(level.observed, fit.efficiency);
    const double upper = level.observed.value * dof / chi_squared_quantile(dof, tail);
    const double room = upper - (fit.model_error > 0.0 ? 0.0 : model_wv(rest, level.observed.level));
    if (room > 0.0) most = std::min(most, room / unit(level.observed.level));
  }
  return most;
}

double normal_quantile_of(double confidence) {
  return boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + confidence));
}

Felt as_bound(double fitted, double bound) {
  if (!std::isfinite(bound)) return {fitted, fitted, 0.0, Knowledge::kUnknown};
  return {bound, bound, 0.0, Knowledge::kBound};
}

/// A function of the model as value and interval where the data tell it, else the most that they allow.
Felt felt(Told& told, const OfModel& f, const std::function<double()>& bound) {
  const double value = f(told.fit.model);
  if (value > 0.0) {
    const double log_sd = told.uncertainty().log_sd(f);
    if (log_sd < kUndetermined) {
      const double z = normal_quantile_of(told.fit.confidence);
      const auto profile = told.uncertainty().profile(f, z);
      const auto range = profile.value_or(Uncertainty::Range{-z * log_sd, z * log_sd});
      return {value, value * std::exp(range.high), value * std::exp(range.low), Knowledge::kFitted};
    }
  }
  return as_bound(value, bound());
}

/// The model without (or with only) what is slow.
Model part_of(const Model& model, double rate_hz, double fast_s, bool slow) {
  Model part;
  for (const Component& c : without_power_laws(model).components) {
    if (is_slow(c, rate_hz, fast_s) == slow) part.components.push_back(c);
  }
  return part;
}

Felt told_white_density(Told& told, double fast_s) {
  const FitResult& fit = told.fit;
  const double f = fit.rate_hz;
  return felt(
      told, [&](const Model& m) { return white_of(m, f, fast_s); },
      [&] {
        // What is white but no white noise (quantization) has its own curve, and stays beside it.
        Model rest;
        for (const Component& c : without_power_laws(fit.model).components) {
          if (is_slow(c, f, fast_s) || low_frequency_variance(c) <= 0.0) rest.components.push_back(c);
        }
        return most_of(
            fit, [&](int level) { return f * unit_wv(ProcessKind::kWhiteNoise, {}, level).value; }, rest);
      });
}

/// A fit's own parameter of one component; nullptr where there is none of that name.
const ParameterEstimate* parameter_of(const FitResult& fit, std::size_t component, int shape) {
  const auto places = parameter_places(fit.model);
  for (std::size_t p = 0; p < places.size() && p < fit.parameters.size(); ++p) {
    if (places[p].component == component && places[p].shape == shape) return &fit.parameters[p];
  }
  return nullptr;
}

bool has_interval(const ParameterEstimate* p) {
  return p != nullptr && p->ci_low && p->ci_high && std::isfinite(*p->ci_low) && std::isfinite(*p->ci_high) &&
         *p->ci_low > 0.0;
}

/// An amplitude by its own interval: a value, or a bound where that has an upper end alone. A rejected
/// model's bound trusts the rest of the model, and is none.
std::optional<Felt> own_amplitude(const FitResult& fit, std::size_t component) {
  const ParameterEstimate* p = parameter_of(fit, component, -1);
  if (p == nullptr) return std::nullopt;
  const bool is_root = parameter_scale_of(p->name) == ParameterScale::kLogSquare;
  const auto squared = [&](double v) { return is_root ? v * v : v; };
  if (has_interval(p))
    return Felt{fit.model.components[component].amplitude, squared(*p->ci_high), squared(*p->ci_low),
                Knowledge::kFitted};
  if (p->ci_low || !p->ci_high || !std::isfinite(*p->ci_high) || fit.model_error > 0.0) return std::nullopt;
  return Felt{squared(*p->ci_high), squared(*p->ci_high), 0.0, Knowledge::kBound};
}

/// Where a random walk is all that is slow, it is its own walk. A quick interval knows no more than the
/// covariance.
std::optional<Felt> own_walk(const FitResult& fit, double fast_s) {
  if (fit.intervals != Intervals::kInverted) return std::nullopt;
  std::optional<std::size_t> only;
  for (std::size_t i = 0; i < fit.model.components.size(); ++i) {
    const Component& c = fit.model.components[i];
    const bool is_walk = c.kind == ProcessKind::kRandomWalk;
    if (white_share(c, fit.rate_hz, fast_s) >= 1.0 || (!is_walk && c.amplitude <= 0.0)) continue;
    if (only || !is_walk) return std::nullopt;
    only = i;
  }
  if (!only) return std::nullopt;
  auto own = own_amplitude(fit, *only);
  if (own) {
    for (double* v : {&own->value, &own->upper, &own->lower}) *v *= fit.rate_hz;
  }
  return own;
}

Felt walk_density(Told& told, double fast_s, const FilterBand& band) {
  const FitResult& fit = told.fit;
  const double f = fit.rate_hz;
  if (const auto own = own_walk(fit, fast_s)) return *own;
  const auto value = [&](const Model& m) {
    const SlowPart slow(m, f, fast_s);
    return slow.growth(band.to_s) > 0.0 ? walk_of(slow, band) : 0.0;
  };
  return felt(told, value, [&] {
    return most_of(
        fit, [&](int level) { return unit_wv(ProcessKind::kRandomWalk, {}, level).value / f; },
        part_of(fit.model, f, fast_s, false));
  });
}

/// What counts as white beside a bias: the slowest process is the bias where nothing is slower than the band.
double fast_beside_bias_s(const FitResult& fit, const FilterBand& band) {
  double slowest_s = 0.0;
  for (const Component& c : fit.model.components) {
    if (c.amplitude <= 0.0) continue;
    if (c.kind != ProcessKind::kGaussMarkov && is_slow(c, fit.rate_hz, band.from_s)) return band.from_s;
    if (c.kind == ProcessKind::kGaussMarkov && c.shape[0] * kBiasSamples <= 1.0)
      slowest_s = std::max(slowest_s, 1.0 / (c.shape[0] * fit.rate_hz));
  }
  return slowest_s > 0.0 ? std::min(band.from_s, slowest_s / kEdge) : band.from_s;
}

/// The one Gauss-Markov process that makes the slow growth, told by the data; absent where there is none.
std::optional<FeltBias> own_process(const FitResult& fit, double fast_s, const FilterBand& band) {
  const double f = fit.rate_hz;
  const SlowPart all(fit.model, f, fast_s);
  std::optional<std::size_t> only;
  for (std::size_t i = 0; i < fit.model.components.size(); ++i) {
    const Component& c = fit.model.components[i];
    if (white_share(c, f, fast_s) >= 1.0 || c.amplitude <= 0.0) continue;
    const SlowPart own(Model{{c}}, f, fast_s);
    const auto share = [&](double time_s) { return own.growth(time_s) / all.growth(time_s); };
    const bool is_told = has_interval(parameter_of(fit, i, -1));
    if (std::max(share(band.from_s), share(band.to_s)) < (is_told ? kNegligibleShare : kNegligibleUntold))
      continue;
    if (only || c.kind != ProcessKind::kGaussMarkov || white_share(c, f, fast_s) > 0.0) return std::nullopt;
    only = i;
  }
  if (!only) return std::nullopt;
  const ParameterEstimate* beta = parameter_of(fit, *only, 0);
  const ParameterEstimate* variance = parameter_of(fit, *only, -1);
  if (!has_interval(beta) || !has_interval(variance)) return std::nullopt;
  FeltBias bias;
  bias.tau_s = 1.0 / beta->value;
  bias.tau_log_sd = std::log(*beta->ci_high / *beta->ci_low) / (2.0 * normal_quantile_of(fit.confidence));
  bias.variance = {variance->value, *variance->ci_high, *variance->ci_low, Knowledge::kFitted};
  bias.as_fitted = true;
  return bias;
}

Felt bias_variance(Told& told, double fast_s, const FilterBand& band, double tau_s) {
  const FitResult& fit = told.fit;
  const double f = fit.rate_hz;
  const auto value = [&](const Model& m) {
    const SlowPart slow(m, f, fast_s);
    return slow.growth(band.to_s) > 0.0 ? bias_variance_of(slow, band, tau_s) : 0.0;
  };
  return felt(told, value, [&] {
    return most_of(
        fit, [&](int level) { return gauss_markov_wv(1.0 / (tau_s * f), level).value; },
        part_of(fit.model, f, fast_s, false));
  });
}

/// The correlation time of the process in the place of the slow terms.
double time_in_place(const FitResult& fit, double fast_s, const FilterBand& band) {
  const SlowPart slow(fit.model, fit.rate_hz, fast_s);
  return slow.growth(band.to_s) > 0.0 ? best_tau(slow, band) : band.to_s;
}

}  // namespace

const char* knowledge_name(Knowledge knowledge) noexcept {
  constexpr const char* kNames[] = {"fitted", "bound", "unknown"};
  return kNames[static_cast<std::size_t>(knowledge)];
}

double white_density(const Model& model, double rate_hz, const FilterBand& band) {
  return white_of(model, rate_hz, band.from_s);
}

Felt felt_white_density(const FitResult& fit, const FilterBand& band) {
  Told told(fit);
  return told_white_density(told, band.from_s);
}

Felt felt_walk_density(const FitResult& fit, const FilterBand& band) {
  Told told(fit);
  return walk_density(told, band.from_s, band);
}

FeltWithWalk felt_with_walk(const FitResult& fit, const FilterBand& band) {
  Told told(fit);
  FeltWithWalk out;
  out.white_density = told_white_density(told, band.from_s);
  out.walk_density = walk_density(told, band.from_s, band);
  return out;
}

Felt felt_white_beside_bias(const FitResult& fit, const FilterBand& band) {
  Told told(fit);
  return told_white_density(told, fast_beside_bias_s(fit, band));
}

BiasTime felt_bias_time(const FitResult& fit, const FilterBand& band) {
  const double fast_s = fast_beside_bias_s(fit, band);
  if (const auto own = own_process(fit, fast_s, band)) return {own->tau_s, own->tau_log_sd};
  return {time_in_place(fit, fast_s, band), {}};
}

FeltWithBias felt_with_bias(const FitResult& fit, const FilterBand& band) {
  const double fast_s = fast_beside_bias_s(fit, band);
  Told told(fit);
  FeltWithBias out;
  out.white_density = told_white_density(told, fast_s);
  if (const auto own = own_process(fit, fast_s, band)) {
    out.bias = *own;
    return out;
  }
  out.bias.tau_s = time_in_place(fit, fast_s, band);
  out.bias.variance = bias_variance(told, fast_s, band, out.bias.tau_s);
  return out;
}

FeltWithBias felt_with_bias(const FitResult& fit, const FilterBand& band, double tau_s) {
  const double fast_s = fast_beside_bias_s(fit, band);
  Told told(fit);
  FeltWithBias out;
  out.white_density = told_white_density(told, fast_s);
  const auto own = own_process(fit, fast_s, band);
  if (own) out.bias = *own;
  const double z = normal_quantile_of(fit.confidence);
  const bool is_own_time = own && std::abs(std::log(tau_s / own->tau_s)) <= z * *own->tau_log_sd;
  if (!is_own_time) {
    out.bias.variance = bias_variance(told, fast_s, band, tau_s);
    out.bias.as_fitted = false;
  }
  out.bias.tau_s = tau_s;
  return out;
}

std::optional<double> told_log_sd(const FitResult& fit, const OfModel& function) {
  const double log_sd = Uncertainty(fit).log_sd(function);
  if (!(log_sd < kUndetermined)) return std::nullopt;
  return log_sd;
}

Felt felt_amplitude(const FitResult& fit, std::size_t component) {
  if (const auto own = own_amplitude(fit, component)) return *own;
  const Component& c = fit.model.components[component];
  Model rest = fit.model;
  rest.components.erase(rest.components.begin() + static_cast<std::ptrdiff_t>(component));
  return as_bound(c.amplitude,
                  most_of(
                      fit, [&](int level) { return unit_wv(c.kind, c.shape, level).value; }, rest));
}

SlowTerms slow_terms(const FitResult& fit, const FilterBand& band) {
  SlowTerms slow;
  const std::vector<std::string> of_components = component_names(fit.model);
  for (std::size_t i = 0; i < of_components.size(); ++i) {
    const Component& c = fit.model.components[i];
    if (c.amplitude <= 0.0 || white_share(c, fit.rate_hz, band.from_s) >= 1.0) continue;
    slow.names += (slow.names.empty() ? "" : "+") + of_components[i];
    slow.kinds.push_back(c.kind);
  }
  return slow;
}

std::string missed_level(const FitResult& fit, const FilterBand& band) {
  if (fit.model_error >= kMostModelError)
    return fmt::format("the model misses every level by {:.3g} % or so", 100.0 * fit.model_error);
  constexpr double kIntervals = 2.0;  // so that one level of many is not missed by chance
  std::string worst;
  double worst_excess = 0.0;
  for (const FittedLevel& level : fit.wv) {
    const double tau_s = level.observed.tau_samples / fit.rate_hz;
    if (tau_s < band.from_s || tau_s > band.to_s || !has_enough_coefficients(level.observed, fit.efficiency))
      continue;
    const double miss = std::log(level.fitted / level.observed.value);
    const double interval = miss > 0.0 ? std::log(level.observed.ci_high / level.observed.value)
                                       : std::log(level.observed.value / level.observed.ci_low);
    const double excess = std::abs(miss) - kIntervals * (interval + std::log1p(fit.model_error));
    if (!(excess > worst_excess) && std::isfinite(excess)) continue;
    worst_excess = excess;
    worst = fmt::format("the model is {:.3g} times the wavelet variance at tau = {:.4g} s, and states {}",
                        level.fitted / level.observed.value, tau_s,
                        fit.model_error > 0.0 ? fmt::format("{:.2g} %", 100.0 * fit.model_error)
                                              : std::string("no error of its own"));
  }
  return worst;
}

}  // namespace imuscope::noise
