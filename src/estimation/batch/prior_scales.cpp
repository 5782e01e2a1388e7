#include "estimation/batch/prior_scales.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <array>
#include <cmath>

namespace imuscope::batch {

namespace {

/// Weight of the class, in imperfections seen, against what the drive shows.
constexpr double kClassWeight = 3.0;
/// By how much (natural logarithm) one chip must be likelier than three to be believed: 150 to one. Of sensors with
/// three, at most one in 150 is then taken for one chip, whatever their noise: the likelihood ratio has mean one where
/// its denominator is true (Markov's inequality).
constexpr double kLogOddsMin = 5.0;
/// The first fall may be of an estimate that has not settled.
constexpr int kFallsMost = 2;

/// Parameters that are of one kind, and so of one size.
struct Kind {
  Eigen::Index first;
  Eigen::Index count;
  bool may_be_smaller;  ///< than the class says
};
constexpr std::array<Kind, 14> kKinds{{{kGyroShape, 3, false},
                                       {kGyroShape + 3, 3, false},
                                       {kAlpha, 3, false},
                                       {kAccelShape, 3, false},
                                       {kAccelShape + 3, 3, false},
                                       {kAccelDelay, 1, false},
                                       {kGSensitivity, 9, false},
                                       {kFlexure, 9, true},
                                       {kAccelFade, 3, true},
                                       {kAccelFlexure, 6, true},
                                       {kCompliance, 9, true},
                                       {kDispersion, 2, false},
                                       {kReferenceAccelDelay, 1, false},
                                       {kReferenceAccelDelay + 1, 1, false}}};

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// B-17: logarithm of the likelihood of places of this sd, against none at all.
double log_evidence(const Matrix6& information, const Vector6& score, double sd) {
  const double variance = sd * sd;
  const Matrix6 scaled = Matrix6::Identity() + variance * information;
  const Matrix6 posterior = information + Matrix6::Identity() / variance;
  return -0.5 * std::log(scaled.determinant()) + 0.5 * score.dot(posterior.llt().solve(score));
}

}  // namespace

PriorScales::PriorScales(const SensorClass& sensor)
    : sensor_(sensor), class_sd_(prior_sd(sensor)), sd_(class_sd_) {}

ParameterVector PriorScales::precision() const {
  ParameterVector precision;
  for (Eigen::Index i = 0; i < kParameters; ++i)
    precision[i] = std::isfinite(sd_[i]) ? 1.0 / (sd_[i] * sd_[i]) : 0.0;
  return precision;
}

// B-16
void PriorScales::learn_sizes(const ParameterVector& x, const Covariance& covariance) {
  for (const Kind& kind : kKinds) {
    const double of_class = class_sd_[kind.first] * class_sd_[kind.first];
    const double seen = x.segment(kind.first, kind.count).squaredNorm() +
                        covariance.diagonal().segment(kind.first, kind.count).sum();
    double variance = (kClassWeight * of_class + seen) / (kClassWeight + static_cast<double>(kind.count));
    if (!kind.may_be_smaller) variance = std::max(variance, of_class);
    sd_.segment(kind.first, kind.count).setConstant(std::sqrt(variance));
  }
}

// B-17: information and score of the places, and the choice
void PriorScales::choose_places(const ParameterVector& x, const Covariance& per_slope) {
  const Matrix6 posterior = per_slope.block<6, 6>(kPlaces, kPlaces).inverse();
  const Vector6 score = posterior * x.segment<6>(kPlaces);
  const Matrix6 information = posterior - Matrix6::Identity() / (sd_[kPlaces] * sd_[kPlaces]);
  const double chip = log_evidence(information, score, sensor_.one_chip_place_sd_m);
  const double chips = log_evidence(information, score, sensor_.place_sd_m);
  log_odds_ = chip - chips;
  const bool is_likelier = log_odds_ > kLogOddsMin;
  if (one_chip_ && !is_likelier) ++falls_;
  one_chip_ = is_likelier && falls_ < kFallsMost;
  sd_.segment<6>(kPlaces).setConstant(one_chip_ ? sensor_.one_chip_place_sd_m : sensor_.place_sd_m);
}

// B-17a
PriorScales::Covariance PriorScales::doubt(const ParameterVector& x, const Covariance& per_slope) const {
  if (!one_chip_) return Covariance::Zero();
  const double chip = std::pow(sensor_.one_chip_place_sd_m, 2);
  const double chips = std::pow(sensor_.place_sd_m, 2);
  const double less_precision = 1.0 / chip - 1.0 / chips;
  // per_slope of three places, by Woodbury: only six of the parameters have another prior. At least what the prior
  // of three leaves: no drive knows less.
  const auto to_places = per_slope.middleCols<6>(kPlaces);
  const Eigen::SelfAdjointEigenSolver<Matrix6> inner(
      Matrix6(Matrix6::Identity() / less_precision - per_slope.block<6, 6>(kPlaces, kPlaces)));
  const Vector6 inverse = inner.eigenvalues().cwiseMax(chip * chip / chips).cwiseInverse();
  const Eigen::Matrix<double, kParameters, 6> across = to_places * inner.eigenvectors();
  const Covariance growth = across * inverse.asDiagonal() * across.transpose();
  const ParameterVector move =
      less_precision * (to_places + growth.middleCols<6>(kPlaces)) * x.segment<6>(kPlaces);
  const double probability = 1.0 / (1.0 + std::exp(log_odds_));
  return probability * (growth + move * move.transpose());
}

}  // namespace imuscope::batch
