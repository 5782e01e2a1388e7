#pragma once

/// Of CovarianceTable alone: where sums over lags (G-8) are evaluated, and the values of processes there.

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <tuple>
#include <vector>

#include "models/noise/cross_covariance.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// Two levels of which a covariance is wanted.
struct PairOfLevels {
  std::size_t j = 0;
  std::size_t k = 0;
  double n_j = 0.0;
  double n_k = 0.0;

  [[nodiscard]] double shorter() const { return std::min(n_j, n_k); }
};

/// Which lags are summed.
struct Lags {
  double exact_near = 0.0;  ///< each one up to so far from a break point
  double below = 0.0;       ///< of the pairs whose shorter n is less

  bool operator<(const Lags& other) const {
    return std::tie(exact_near, below) < std::tie(other.exact_near, other.below);
  }
};

/// Lags of some pairs of levels, pair after pair, with their weights.
class CovariancePlaces {
 public:
  CovariancePlaces(const WaveletVariance& record, std::size_t levels, const Lags& lags);

  [[nodiscard]] const std::vector<PairOfLevels>& pairs() const { return pairs_; }
  /// Of each pair among all pairs of levels.
  [[nodiscard]] const std::vector<std::size_t>& numbers() const { return numbers_; }
  /// Where the places of a pair begin, and how many they are.
  [[nodiscard]] Eigen::Index begin(std::size_t pair) const {
    return static_cast<Eigen::Index>(runs_[first_[pair]].begin);
  }
  [[nodiscard]] Eigen::Index size(std::size_t pair) const {
    return static_cast<Eigen::Index>(runs_[first_[pair + 1] - 1].end) - begin(pair);
  }
  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(x_.size()); }
  /// Of each place, with the pairs of coefficients at its lag.
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> weights() const {
    return {weight_.data(), static_cast<Eigen::Index>(weight_.size())};
  }

  /// G-9: C_jk(h) of a process at all places. No oscillations.
  [[nodiscard]] Eigen::VectorXd values(const Parts& process) const;
  /// G-42: sum of weight 2 a b, pair by pair: K.
  [[nodiscard]] Eigen::VectorXd product(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;
  /// Sum of weight a, pair by pair.
  [[nodiscard]] Eigen::VectorXd mean(const Eigen::VectorXd& a) const;
  /// G-37 in G-9: adds C_jk(h) of a resonance at the places of a pair, which are all of `values`. Lags that
  /// follow each other cost two products.
  void add_oscillation(const Oscillation& o, std::size_t pair, Eigen::Ref<Eigen::VectorXd> values) const;

  /// What all of it takes, in doubles.
  [[nodiscard]] friend std::size_t doubles_of(const CovariancePlaces& places) {
    return places.x_.size() + places.weight_.size() + places.runs_.size() * sizeof(Run) / sizeof(double);
  }

 private:
  class Collector;

  /// Places strictly between two break points, as distances from the centre, or one on a break point; of the
  /// latter p is the break point and q the next one.
  struct Run {
    double p = 0.0;
    double q = 0.0;
    bool is_break = false;
    std::size_t begin = 0;
    std::size_t end = 0;
  };

  template <typename F>
  Eigen::VectorXd over_pairs(F f) const;

  std::vector<PairOfLevels> pairs_;
  std::vector<std::size_t> numbers_;
  std::vector<std::size_t> first_;  ///< run of each pair
  std::vector<Run> runs_;
  std::vector<double> x_;       ///< distances from the centre
  std::vector<double> weight_;  ///< with the pairs of coefficients there
};

}  // namespace imuscope::noise
