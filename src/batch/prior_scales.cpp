#include "batch/prior_scales.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>

namespace imuscope::batch {

namespace {

/// Weight of the class, in imperfections seen, against what the drive shows.
constexpr double kClassWeight = 3.0;
/// By how much (natural logarithm) one chip must be likelier than three to be believed: one to twenty.
constexpr double kEvidenceMin = 3.0;

/// Parameters that are of one kind, and so of one size.
struct Kind {
  Eigen::Index first;
  Eigen::Index count;
  bool may_be_smaller;  ///< than the class says
};
constexpr std::array<Kind, 11> kKinds{{{kGyroShape, 3, false},
                                       {kGyroShape + 3, 3, false},
                                       {kAlpha, 3, false},
                                       {kAccelShape, 3, false},
                                       {kAccelShape + 3, 3, false},
                                       {kAccelDelay, 1, false},
                                       {kGSensitivity, 9, false},
                                       {kFlexure, 9, true},
                                       {kAccelFade, 3, true},
                                       {kAccelFlexure, 6, true},
                                       {kCompliance, 9, true}}};

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

void PriorScales::learn(const ParameterVector& x,
                        const Eigen::Matrix<double, kParameters, kParameters>& covariance) {
  for (const Kind& kind : kKinds) {
    const double of_class = class_sd_[kind.first] * class_sd_[kind.first];
    const double seen = x.segment(kind.first, kind.count).squaredNorm() +
                        covariance.diagonal().segment(kind.first, kind.count).sum();
    double variance = (kClassWeight * of_class + seen) / (kClassWeight + static_cast<double>(kind.count));
    if (!kind.may_be_smaller) variance = std::max(variance, of_class);
    sd_.segment(kind.first, kind.count).setConstant(std::sqrt(variance));
  }
  choose_places(x, covariance);
}

void PriorScales::choose_places(const ParameterVector& x,
                                const Eigen::Matrix<double, kParameters, kParameters>& covariance) {
  const Matrix6 posterior = covariance.block<6, 6>(kPlaces, kPlaces).inverse();
  const Vector6 score = posterior * x.segment<6>(kPlaces);
  const Matrix6 information = posterior - Matrix6::Identity() / (sd_[kPlaces] * sd_[kPlaces]);
  const double chip = log_evidence(information, score, sensor_.one_chip_place_sd_m);
  const double chips = log_evidence(information, score, sensor_.place_sd_m);
  one_chip_ = chip - chips > kEvidenceMin;
  sd_.segment<6>(kPlaces).setConstant(one_chip_ ? sensor_.one_chip_place_sd_m : sensor_.place_sd_m);
}

}  // namespace imuscope::batch
