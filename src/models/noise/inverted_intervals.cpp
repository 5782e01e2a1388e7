#include "models/noise/inverted_intervals.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "models/noise/chi_squared.h"
#include "models/noise/compare.h"
#include "models/noise/fixed_point.h"
#include "models/noise/inference.h"
#include "models/noise/loose_rates.h"

namespace imuscope::noise {
namespace {

/// Below this log-sd the estimate's own covariance is as good: estimates are near enough to Gaussian.
constexpr double kQuickBelowLogSd = 0.05;
/// Logarithms: a term so much smaller than every level, or so much larger than one, can change no more.
constexpr double kFarBelow = 9.0;
constexpr double kFarAbove = 3.0;
/// How far beyond that the search for the other parameters may go.
constexpr double kBeyond = 12.0;

/// Sampling covariance of many models of one wavelet variance. What stretches and missing samples make of it
/// depends little on the model: it is computed for one, as a factor of every entry beside that of a record
/// whose coefficients lie in one run (G-41), which takes a small part of the time.
class CovarianceOfModels {
 public:
  CovarianceOfModels(const Model& model, const WaveletVariance& wv, std::size_t rows,
                     CovarianceTables* tables)
      : wv_(wv), in_one_run_(wv), rows_(rows) {
    const bool has_stretches =
        wv.segments.size() > 1 ||
        std::any_of(wv.levels.begin(), wv.levels.end(), [](const WvLevel& l) { return !l.places.empty(); });
    if (has_stretches) {
      in_one_run_.segments.clear();
      for (WvLevel& level : in_one_run_.levels) level.places.clear();
    }
    if (tables != nullptr) table_ = tables->of(in_one_run_, rows);
    if (has_stretches) factor_ = sampling_covariance(model, wv_, rows).cwiseQuotient(of_one_run(model));
  }

  [[nodiscard]] Eigen::MatrixXd of(const Model& model) const {
    if (factor_.size() == 0) return of_one_run(model);
    if (!factor_.allFinite()) return sampling_covariance(model, wv_, rows_);
    Eigen::MatrixXd v = factor_.cwiseProduct(of_one_run(model));
    // A product of entries need not be a covariance.
    return v.llt().info() == Eigen::Success ? v : sampling_covariance(model, wv_, rows_);
  }

 private:
  [[nodiscard]] Eigen::MatrixXd of_one_run(const Model& model) const {
    return sampling_covariance(model, in_one_run_, rows_, table_.get());
  }

  const WaveletVariance& wv_;
  WaveletVariance in_one_run_;
  std::size_t rows_;
  std::shared_ptr<const CovarianceTable> table_;
  Eigen::MatrixXd factor_;
};

/// One model's parameters as a vector on the scales of their intervals, and the levels that they are fitted
/// to.
class Inversion {
 public:
  Inversion(const FitResult& fit, const CovarianceOfModels& covariances, std::size_t rows)
      : covariances_(covariances),
        base_(fit.model),
        places_(parameter_places(fit.model)),
        model_error_(fit.model_error) {
    y_.resize(static_cast<Eigen::Index>(rows));
    for (std::size_t i = 0; i < rows; ++i) {
      levels_.push_back(fit.wv[i].observed.level);
      y_[static_cast<Eigen::Index>(i)] = fit.wv[i].observed.value;
    }
    estimate_.resize(static_cast<Eigen::Index>(places_.size()));
    for (std::size_t p = 0; p < places_.size(); ++p) estimate_[static_cast<Eigen::Index>(p)] = coordinate(p);
  }

  [[nodiscard]] double estimate(std::size_t p) const { return estimate_[static_cast<Eigen::Index>(p)]; }
  [[nodiscard]] const ParameterPlace& place(std::size_t p) const { return places_[p]; }
  [[nodiscard]] const Component& component(std::size_t p) const {
    return base_.components[places_[p].component];
  }

  /// Range of a parameter's coordinate: of an amplitude from where no level shows the term to where it is
  /// more than any level. An end that is not reached there is none.
  [[nodiscard]] CoordinateRange range(std::size_t p) const {
    const Component& c = component(p);
    if (places_[p].shape >= 0) return coordinate_range(c.kind, places_[p].shape, levels_.back());
    CoordinateRange out{estimate(p), estimate(p)};
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      const double at_level =
          std::log(y_[static_cast<Eigen::Index>(i)] / unit_wv(c.kind, c.shape, levels_[i]).value);
      out.low = std::min(out.low, at_level - kFarBelow);
      out.high = std::max(out.high, at_level + kFarAbove);
    }
    return out;
  }

  /// A term of amplitude zero is given one that no level shows yet.
  void make_present(std::size_t p, double share = kInvisible) {
    Component& c = base_.components[places_[p].component];
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      const double unit = unit_wv(c.kind, c.shape, levels_[i]).value;
      least = std::min(least, y_[static_cast<Eigen::Index>(i)] / unit);
    }
    c.amplitude = share * least;
    estimate_[static_cast<Eigen::Index>(p)] = coordinate(p);
  }

  /// G-36: the same with terms of amplitude zero as terms that no level shows yet: what the others may be is not
  /// bounded by a zero. Nothing where there is none, or it has a shape that nothing tells.
  [[nodiscard]] std::optional<Inversion> with_zeros_present() const {
    Inversion out = *this;
    bool has_zero = false;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (places_[p].shape >= 0 || component(p).amplitude > 0.0 || shape_count(component(p).kind) > 0)
        continue;
      out.make_present(p);
      has_zero = true;
    }
    if (!has_zero) return std::nullopt;
    out.best_ = out.estimate_;
    return out;
  }

  /// G-20: test that parameter p is `value`, ~ chi2 with one degree of freedom. `others` is where the search for
  /// the other parameters starts and becomes where it ends.
  double statistic(std::size_t p, double value, Eigen::VectorXd& others) const {
    constexpr int kWeightRounds = 2;
    others[static_cast<Eigen::Index>(p)] = value;
    Problem problem;
    for (int round = 0; round < kWeightRounds; ++round) {
      problem = problem_at(others);
      if (problem.whitener.size() == 0) return 0.0;
      minimise(problem, others, p);
    }
    Eigen::VectorXd free = others;
    const double fixed = cost(problem, others);
    const double from_here = minimise(problem, free, kNone);
    Eigen::VectorXd other_start = best_.size() > 0 ? best_ : estimate_;
    return std::max(0.0, fixed - std::min(from_here, minimise(problem, other_start, kNone)));
  }

  [[nodiscard]] const Eigen::VectorXd& start() const { return estimate_; }

  /// Whether a Gauss-Markov process of the model is known so badly that another place of it may do as well.
  [[nodiscard]] bool has_loose_markov(const FitResult& fit) const {
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (component(p).kind != ProcessKind::kGaussMarkov) continue;
      const auto& log_sd = fit.parameters[p].log_sd;
      if (component(p).amplitude <= 0.0 || !log_sd || *log_sd > kLooseLogSd) return true;
    }
    return false;
  }

  /// G-36: the same problem about other sets of parameters that the data reject no more than the estimate: one
  /// process stands elsewhere, and the others, in order of their rates again, have taken over its part.
  [[nodiscard]] std::vector<Inversion> rivals(double critical) const {
    constexpr int kPlaces = 7;
    std::vector<Inversion> found;
    const Problem problem = problem_at(estimate_);
    if (problem.whitener.size() == 0) return found;
    const double best = cost(problem, estimate_);
    Inversion all_present = *this;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (places_[p].shape < 0 && component(p).amplitude <= 0.0) all_present.make_present(p);
    }
    all_present.best_ = all_present.estimate_;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (component(p).kind != ProcessKind::kGaussMarkov || places_[p].shape < 0) continue;
      const CoordinateRange r = range(p);
      for (int k = 0; k < kPlaces; ++k) {
        Inversion other = all_present;
        other.move_markov(places_[p].component, r.low + (k + 0.5) / kPlaces * (r.high - r.low));
        if (other.minimise(problem, other.estimate_, kNone) - best > critical) continue;
        other.sort_markov();
        if (std::none_of(found.begin(), found.end(), [&](const Inversion& f) { return f.is_near(other); }) &&
            !all_present.is_near(other))
          found.push_back(std::move(other));
      }
    }
    return found;
  }

 private:
  /// A process of that coordinate of its rate, with an amplitude that levels show a little.
  void move_markov(std::size_t component, double rate_coordinate) {
    Component& c = base_.components[component];
    c.shape[0] = shape_of_coordinate(c.kind, rate_coordinate);
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (places_[p].component != component) continue;
      if (places_[p].shape < 0)
        make_present(p, kVisible);
      else
        estimate_[static_cast<Eigen::Index>(p)] = rate_coordinate;
    }
  }

  /// Places of amplitude and rate of each Gauss-Markov process.
  [[nodiscard]] std::vector<std::pair<Eigen::Index, Eigen::Index>> markov_places() const {
    std::vector<std::pair<Eigen::Index, Eigen::Index>> out;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (component(p).kind != ProcessKind::kGaussMarkov || places_[p].shape < 0) continue;
      for (std::size_t q = 0; q < places_.size(); ++q) {
        if (places_[q].component == places_[p].component && places_[q].shape < 0)
          out.emplace_back(static_cast<Eigen::Index>(q), static_cast<Eigen::Index>(p));
      }
    }
    return out;
  }

  /// In the order of the estimate: of falling rate.
  void sort_markov() {
    const auto places = markov_places();
    std::vector<std::pair<double, double>> values;  // rate, amplitude
    for (const auto& [amplitude, rate] : places) values.emplace_back(beta_at(rate), estimate_[amplitude]);
    std::vector<std::size_t> order(values.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return values[a].first > values[b].first; });
    const Eigen::VectorXd before = estimate_;
    for (std::size_t i = 0; i < order.size(); ++i) {
      estimate_[places[i].first] = before[places[order[i]].first];
      estimate_[places[i].second] = before[places[order[i]].second];
    }
  }

  [[nodiscard]] double beta_at(Eigen::Index rate) const {
    return shape_of_coordinate(ProcessKind::kGaussMarkov, estimate_[rate]);
  }

  /// All rates within half an octave or so.
  [[nodiscard]] bool is_near(const Inversion& other) const {
    constexpr double kNear = 0.4;  // of the logarithm
    return std::ranges::all_of(markov_places(), [&](const auto& place) {
      return std::abs(estimate_[place.second] - other.estimate_[place.second]) < kNear;
    });
  }

  static constexpr double kInvisible = 1e-2;  ///< share of the lowest level that a new term has
  static constexpr double kVisible = 0.3;
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  struct Problem {
    Eigen::MatrixXd whitener;
    Eigen::VectorXd y;  ///< the levels, their skewness taken out as the weights' model has it
  };

  [[nodiscard]] double coordinate(std::size_t p) const {
    const Component& c = component(p);
    const int s = places_[p].shape;
    if (s >= 0) return coordinate_of_shape(c.kind, c.shape[static_cast<std::size_t>(s)]);
    return c.amplitude > 0.0 ? std::log(c.amplitude) : 0.0;
  }

  [[nodiscard]] Model model_at(const Eigen::VectorXd& u) const {
    Model model = base_;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      Component& c = model.components[places_[p].component];
      if (c.amplitude <= 0.0) continue;
      const double v = u[static_cast<Eigen::Index>(p)];
      const int s = places_[p].shape;
      if (s < 0) {
        c.amplitude = std::exp(v);
      } else {
        c.shape[static_cast<std::size_t>(s)] = shape_of_coordinate(c.kind, v);
      }
    }
    return model;
  }

  [[nodiscard]] Eigen::VectorXd curve(const Model& model) const { return wv_curve(model, levels_); }

  /// Weights of the model at u. The levels' residuals are brought to a Gaussian's by cube roots (G-18).
  [[nodiscard]] Problem problem_at(const Eigen::VectorXd& u) const {
    const Model model = model_at(u);
    const Eigen::VectorXd m = curve(model);
    Eigen::MatrixXd v = covariances_.of(model);
    Problem problem;
    problem.y.resize(m.size());
    for (Eigen::Index i = 0; i < m.size(); ++i)
      problem.y[i] = m[i] + near_gaussian_residual(y_[i], m[i], v(i, i));
    for (Eigen::Index i = 0; i < m.size(); ++i)
      v(i, i) += model_error_ * model_error_ * 2.0 * y_[i] * m[i] * m[i] / (y_[i] + m[i]);  // G-15
    problem.whitener = whitener_of(v);
    return problem;
  }

  [[nodiscard]] double cost(const Problem& problem, const Eigen::VectorXd& u) const {
    return (problem.whitener * (problem.y - curve(model_at(u)))).squaredNorm();
  }

  /// Levenberg-Marquardt over the parameters in use but `fixed`; returns the least cost.
  double minimise(const Problem& problem, Eigen::VectorXd& u, std::size_t fixed) const {
    constexpr int kMaxSteps = 40;
    constexpr double kStop = 1e-4;  // beside a chi-square of 3.8
    std::vector<Eigen::Index> free;
    std::vector<CoordinateRange> ranges;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (p == fixed || component(p).amplitude <= 0.0) continue;
      const double beyond = places_[p].shape < 0 ? kBeyond : 0.0;
      const CoordinateRange r = range(p);
      free.push_back(static_cast<Eigen::Index>(p));
      ranges.push_back({r.low - beyond, r.high + beyond});
    }
    double now = cost(problem, u);
    double damping = 1e-3;
    for (int step = 0; step < kMaxSteps && !free.empty() && damping < 1e8; ++step) {
      const Model model = model_at(u);
      const Eigen::MatrixXd d = problem.whitener * wv_jacobian(model, levels_, places_)(Eigen::all, free);
      const Eigen::VectorXd gradient = d.transpose() * (problem.whitener * (problem.y - curve(model)));
      Eigen::MatrixXd normal = d.transpose() * d;
      const Eigen::VectorXd diagonal = normal.diagonal();
      bool improved = false;
      while (!improved && damping < 1e8) {
        normal.diagonal() = diagonal * (1.0 + damping) + Eigen::VectorXd::Constant(diagonal.size(), 1e-12);
        const Eigen::VectorXd move = normal.ldlt().solve(gradient).cwiseMax(-2.0).cwiseMin(2.0);
        Eigen::VectorXd next = u;
        for (std::size_t i = 0; i < free.size(); ++i) {
          next[free[i]] =
              std::clamp(u[free[i]] + move[static_cast<Eigen::Index>(i)], ranges[i].low, ranges[i].high);
        }
        const double trial = cost(problem, next);
        if (trial < now) {
          improved = true;
          const double gain = now - trial;
          u = next;
          now = trial;
          damping = std::max(1e-9, damping * 0.1);
          if (gain < kStop) return now;
        } else {
          damping *= 10.0;
        }
      }
    }
    return now;
  }

  const CovarianceOfModels& covariances_;
  Model base_;
  std::vector<ParameterPlace> places_;
  double model_error_;
  std::vector<int> levels_;
  Eigen::VectorXd y_;
  Eigen::VectorXd estimate_;
  Eigen::VectorXd best_;  ///< where the estimate is another
};

/// G-20. Where the test of parameter p first reaches `critical` in the direction `sign`; nothing where it
/// does not.
std::optional<double> end_of_interval(const Inversion& inversion, std::size_t p, double sign, double step,
                                      double critical) {
  constexpr int kMaxSteps = 14;
  constexpr int kMaxRefinements = 10;
  constexpr double kStraight = 3.0;  // critical roots up to which the root is taken for a straight line
  constexpr double kNear = 0.02;     // of the root of the critical value
  const CoordinateRange range = inversion.range(p);
  const double root_critical = std::sqrt(critical);
  // A search for the other parameters begins where they were at the last value inside: from beyond the end,
  // where they may have run off, it would not find back.
  Eigen::VectorXd others_inside = inversion.start();
  Eigen::VectorXd others;
  double inside = inversion.estimate(p);
  double inside_root = 0.0;
  double outside = inside;
  double outside_root = 0.0;
  for (int i = 0; outside_root < root_critical; ++i) {
    if (i == kMaxSteps) return std::nullopt;
    if (i > 0) {
      inside = outside;
      inside_root = outside_root;
      others_inside = others;
    }
    others = others_inside;
    const double limit = sign > 0.0 ? range.high : range.low;
    if (inside == limit) return std::nullopt;
    outside = sign > 0.0 ? std::min(limit, inside + step) : std::max(limit, inside - step);
    outside_root = std::sqrt(inversion.statistic(p, outside, others));
    step *= 1.5;
  }
  for (int i = 0; i < kMaxRefinements && std::abs(outside_root - root_critical) > kNear * root_critical;
       ++i) {
    const double beyond = std::min(outside_root, kStraight * root_critical);
    const double share = std::clamp((root_critical - inside_root) / (beyond - inside_root), 0.1, 0.95);
    const double middle = inside + share * (outside - inside);
    others = others_inside;
    const double root = std::sqrt(inversion.statistic(p, middle, others));
    if (root >= root_critical) {
      outside = middle;
      outside_root = root;
    } else {
      inside = middle;
      inside_root = root;
      others_inside = others;
      if (root_critical - root <= kNear * root_critical) return middle;
    }
  }
  return outside;
}

/// The estimate and its rivals.
using Candidates = std::vector<Inversion>;

/// G-36: the furthest end of all candidates in one direction; absent where one of them has none.
std::optional<double> furthest_end(const Candidates& candidates, std::size_t place, double sign, double step,
                                   double critical) {
  std::optional<double> furthest;
  for (const Inversion& candidate : candidates) {
    if (furthest && sign * (*furthest - candidate.estimate(place)) > 0.0) {
      // One that the test rejects there ends before.
      Eigen::VectorXd others = candidate.start();
      if (candidate.statistic(place, *furthest, others) >= critical) continue;
    }
    const auto end = end_of_interval(candidate, place, sign, step, critical);
    if (!end) return std::nullopt;
    if (!furthest || sign * *end > sign * *furthest) furthest = end;
  }
  return furthest;
}

void bound_from_above(ParameterEstimate& p, Candidates candidates, std::size_t place, double critical) {
  for (Inversion& candidate : candidates) {
    if (candidate.component(place).amplitude <= 0.0) candidate.make_present(place);
  }
  const auto end = furthest_end(candidates, place, 1.0, 2.0, critical);
  if (end) p.ci_high = from_interval_scale(p, *end);
}

void invert(ParameterEstimate& p, const Candidates& candidates, std::size_t place, double two_sided,
            double one_sided) {
  constexpr double kShortestStep = 0.2;
  constexpr double kLongestStep = 1.5;
  const double step = std::clamp(2.0 * p.log_sd.value_or(1.0), kShortestStep, kLongestStep);
  const double at = candidates.front().estimate(place);
  const auto low = furthest_end(candidates, place, -1.0, step, two_sided);
  const auto high = furthest_end(candidates, place, 1.0, step, two_sided);
  const auto at_place = [&, centre = on_interval_scale(p)](double end) {
    return from_interval_scale(p, centre + end - at);
  };
  p.ci_low.reset();
  p.ci_high.reset();
  if (low && high) {
    p.ci_low = at_place(*low);
    p.ci_high = at_place(*high);
  } else if (const auto only = low    ? furthest_end(candidates, place, -1.0, step, one_sided)
                               : high ? furthest_end(candidates, place, 1.0, step, one_sided)
                                      : std::nullopt) {
    (low ? p.ci_low : p.ci_high) = at_place(*only);
  }
}

}  // namespace

void invert_intervals(FitResult& result, const WaveletVariance& wv, std::size_t levels,
                      const std::vector<bool>& leaning, CovarianceTables* tables) {
  const double two_sided = chi_squared_quantile(1.0, result.confidence);
  // The square of the Gaussian's one-sided quantile.
  const double one_sided = chi_squared_quantile(1.0, 2.0 * result.confidence - 1.0);
  const CovarianceOfModels covariances(result.model, wv, levels, tables);
  Candidates candidates{Inversion(result, covariances, levels)};
  const Inversion inversion = candidates.front();
  const std::optional<Inversion> with_zeros = inversion.with_zeros_present();
  if (with_zeros) candidates.push_back(*with_zeros);
  if (inversion.has_loose_markov(result)) {
    for (Inversion& rival : inversion.rivals(two_sided)) candidates.push_back(std::move(rival));
  }
  for (std::size_t i = 0; i < result.parameters.size(); ++i) {
    ParameterEstimate& p = result.parameters[i];
    if (inversion.component(i).amplitude > 0.0) {
      if (!p.log_sd || *p.log_sd > kQuickBelowLogSd || leaning[i] || with_zeros)
        invert(p, candidates, i, two_sided, one_sided);
    } else if (shape_count(inversion.component(i).kind) == 0) {
      bound_from_above(p, candidates, i, one_sided);
    }
  }
}

}  // namespace imuscope::noise
