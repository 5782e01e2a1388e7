#include "models/noise/covariance_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "models/noise/lag_sum.h"
#include "models/noise/pair_counts.h"

namespace imuscope::noise {
namespace {

/// exp(-z); nothing where it is lost.
Complex faded(Complex z) {
  constexpr double kNothing = 60.0;
  return z.real() < kNothing ? std::exp(-z) : 0.0;
}

/// C_jk between two break points: constant + slope d - Re(left e^{-s d} + right e^{-s (q - h)}).
struct Between {
  double constant = 0.0;
  double slope = 0.0;
  Complex left;
  Complex right;
};

Between between_of(const Oscillation& o, double n_j, double n_k, double p, double q) {
  Between out;
  const Complex variance = o.variance * o.gain;
  const bool is_last = std::isinf(q);
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      const double weight =
          kDifference[static_cast<std::size_t>(a)] * kDifference[static_cast<std::size_t>(b)];
      const double shift = a * n_j - b * n_k;
      const double at = p + shift;
      const double sign = at >= 0.0 ? 1.0 : -1.0;
      if (!is_last) {
        out.constant -= weight * sign * at * o.linear;
        out.slope -= weight * sign * o.linear;
      }
      if (sign > 0.0) {
        out.left += weight * variance * faded(o.rate * at);
      } else {
        out.right += weight * variance * faded(o.rate * -(q + shift));
      }
    }
  }
  return out;
}

}  // namespace

/// Takes down where LagSum evaluates a pair.
class CovariancePlaces::Collector {
 public:
  Collector(CovariancePlaces& places, const PairOfLevels& pair, PairCounts counts)
      : places_(places),
        centre_(pair.n_k - pair.n_j),
        counts_(counts),
        furthest_(std::max(counts_.highest() - centre_, centre_ - counts_.lowest())),
        breaks_(breaks_of_lags(breaks_of(pair.n_j, pair.n_k), counts_, centre_, furthest_)) {}

  void collect(double exact_near, double product_of_counts) {
    const std::size_t begin = places_.x_.size();
    LagSum(*this, exact_near).between(breaks_, 0.0, furthest_);
    for (std::size_t i = begin; i < places_.weight_.size(); ++i) places_.weight_[i] /= product_of_counts;
  }
  void enter(double p, double q) { run_of(p, q, false); }
  void add_inside(double x, double weight) { add(x, weight); }
  void add_at(double x) {
    const auto next = std::upper_bound(breaks_.begin(), breaks_.end(), x);
    run_of(x, next == breaks_.end() ? std::numeric_limits<double>::infinity() : *next, true);
    add(x, 1.0);
  }

 private:
  void run_of(double p, double q, bool is_break) {
    places_.runs_.push_back({p, q, is_break, places_.x_.size(), places_.x_.size()});
  }
  void add(double x, double weight) {
    const double pairs = counts_.at_distance(centre_, x);
    if (pairs == 0.0 && !places_.runs_.back().is_break) return;
    places_.x_.push_back(x);
    places_.weight_.push_back(weight * pairs);
    places_.runs_.back().end = places_.x_.size();
  }

  CovariancePlaces& places_;
  double centre_;
  PairCounts counts_;
  double furthest_;
  std::vector<double> breaks_;
};

CovariancePlaces::CovariancePlaces(const WaveletVariance& record, std::size_t levels, const Lags& lags) {
  std::vector<LevelPlaces> places;
  for (std::size_t j = 0; j < levels; ++j) places.push_back(places_of(record, record.levels[j]));
  std::size_t number = 0;
  for (std::size_t j = 0; j < levels; ++j) {
    for (std::size_t k = 0; k <= j; ++k, ++number) {
      const WvLevel& level_j = record.levels[j];
      const WvLevel& level_k = record.levels[k];
      const PairOfLevels pair{j, k, 0.5 * level_j.tau_samples, 0.5 * level_k.tau_samples};
      if (pair.shorter() >= lags.below) continue;
      Collector collector(*this, pair, PairCounts(level_j, level_k, places[j], places[k]));
      first_.push_back(runs_.size());
      collector.collect(lags.exact_near, static_cast<double>(level_j.n_coefficients) *
                                             static_cast<double>(level_k.n_coefficients));
      pairs_.push_back(pair);
      numbers_.push_back(number);
    }
  }
  first_.push_back(runs_.size());
}

Eigen::VectorXd CovariancePlaces::values(const Parts& process) const {
  Eigen::VectorXd out(size());
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    CrossCovariance c(process, pairs_[p].n_j, pairs_[p].n_k);
    const double centre = pairs_[p].n_k - pairs_[p].n_j;
    for (std::size_t r = first_[p]; r < first_[p + 1]; ++r) {
      const Run& run = runs_[r];
      if (!run.is_break) c.enter(centre + run.p, centre + run.q);
      for (std::size_t i = run.begin; i < run.end; ++i)
        out[static_cast<Eigen::Index>(i)] = run.is_break ? c(centre + x_[i]) : c.inside(centre + x_[i]);
    }
  }
  return out;
}

template <typename F>
Eigen::VectorXd CovariancePlaces::over_pairs(F f) const {
  Eigen::VectorXd out(static_cast<Eigen::Index>(pairs_.size()));
  for (std::size_t p = 0; p < pairs_.size(); ++p) out[static_cast<Eigen::Index>(p)] = f(begin(p), size(p));
  return out;
}

Eigen::VectorXd CovariancePlaces::product(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const {
  return over_pairs([&](Eigen::Index begin, Eigen::Index n) {
    return 2.0 * weights().segment(begin, n).cwiseProduct(a.segment(begin, n)).dot(b.segment(begin, n));
  });
}

Eigen::VectorXd CovariancePlaces::mean(const Eigen::VectorXd& a) const {
  return over_pairs([&](Eigen::Index begin, Eigen::Index n) {
    return weights().segment(begin, n).dot(a.segment(begin, n));
  });
}

void CovariancePlaces::add_oscillation(const Oscillation& o, std::size_t pair,
                                       Eigen::Ref<Eigen::VectorXd> values) const {
  const auto [j, k, n_j, n_k] = pairs_[pair];
  const double centre = n_k - n_j;
  const double scale = 1.0 / (4.0 * n_j * n_k);
  const Complex towards = std::exp(-o.rate);
  const Complex back = std::exp(o.rate);
  const auto first = static_cast<std::size_t>(begin(pair));
  Between between;
  for (std::size_t r = first_[pair]; r < first_[pair + 1]; ++r) {
    const Run& run = runs_[r];
    between = between_of(o, n_j, n_k, centre + run.p, centre + run.q);
    Complex left;
    Complex right;
    double last = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = run.begin; i < run.end; ++i) {
      const double x = x_[i];
      if (x == last + 1.0) {
        left *= towards;
        right *= back;
      } else if (x == last - 1.0) {
        left *= back;
        right *= towards;
      } else {
        left = between.left * faded(o.rate * (x - run.p));
        right = std::isinf(run.q) ? 0.0 : between.right * faded(o.rate * (run.q - x));
      }
      last = x;
      values[static_cast<Eigen::Index>(i - first)] +=
          scale * (between.constant + between.slope * (x - run.p) - (left + right).real());
    }
  }
}

}  // namespace imuscope::noise
