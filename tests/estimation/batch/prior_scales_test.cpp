#include "estimation/batch/prior_scales.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

namespace imuscope::batch {
namespace {

using Covariance = PriorScales::Covariance;
using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

Covariance inverse(const Covariance& of) { return of.llt().solve(Covariance::Identity()); }

/// A drive that tells the lever arm and, `tell` times as well, the places, one through the other; all else well.
struct Drive {
  Covariance information = Covariance::Identity() * 1e12;
  Matrix9 root;  ///< of the information of (r, places)

  Drive(double tell, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    for (double& value : root.reshaped()) value = normal(random);
    root.leftCols<3>() *= 600.0;
    root.rightCols<6>() *= 600.0 * tell;
    constexpr std::array<Eigen::Index, 2> kPlace{kLeverArm, kPlaces};
    constexpr std::array<Eigen::Index, 2> kOwn{0, 3};
    constexpr std::array<Eigen::Index, 2> kSize{3, 6};
    const Matrix9 of_both = root.transpose() * root;
    for (std::size_t i = 0; i < 2; ++i)
      for (std::size_t j = 0; j < 2; ++j)
        information.block(kPlace[i], kPlace[j], kSize[i], kSize[j]) =
            of_both.block(kOwn[i], kOwn[j], kSize[i], kSize[j]);
  }

  /// What is estimated of this truth, with the priors in force. Linear: one solution.
  [[nodiscard]] ParameterVector estimate(const Vector9& truth, const Vector9& noise,
                                         const PriorScales& scales) const {
    const Vector9 score = root.transpose() * (root * truth + noise);
    ParameterVector gradient = ParameterVector::Zero();
    gradient.segment<3>(kLeverArm) = score.head<3>();
    gradient.segment<6>(kPlaces) = score.tail<6>();
    return per_slope(scales) * gradient;
  }

  [[nodiscard]] Covariance per_slope(const PriorScales& scales) const {
    return inverse(information + Covariance(scales.precision().asDiagonal()));
  }
};

/// Estimates until the choice is the one that the estimate was made with. False where it goes to and fro.
bool settle(const Drive& drive, const Vector9& truth, const Vector9& noise, PriorScales& scales,
            ParameterVector& x) {
  for (int i = 0; i < 4; ++i) {
    x = drive.estimate(truth, noise, scales);
    const bool before = scales.one_chip();
    scales.choose_places(x, drive.per_slope(scales));
    if (scales.one_chip() == before) return true;
  }
  return false;
}

TEST(PriorScales, DoubtIsWhatThreePlacesWouldMakeOfTheEstimate) {
  std::mt19937_64 random(1);
  const SensorClass sensor;
  const Drive drive(1.0, random);
  Vector9 truth = Vector9::Zero();
  truth[1] = 0.4;
  truth[4] = 0.002;
  PriorScales scales(sensor);
  const PriorScales three = scales;
  ParameterVector x;
  ASSERT_TRUE(settle(drive, truth, Vector9::Zero(), scales, x));
  ASSERT_TRUE(scales.one_chip());

  const Covariance doubt = scales.doubt(x, drive.per_slope(scales));
  const ParameterVector move = drive.estimate(truth, Vector9::Zero(), three) - x;
  const Covariance whole = drive.per_slope(three) - drive.per_slope(scales) + move * move.transpose();
  const double probability = doubt(kPlaces, kPlaces) / whole(kPlaces, kPlaces);
  EXPECT_GT(probability, 0.0);
  EXPECT_LT(probability, 1.0 / 149.0);  // B-17: believed at 150 to one
  EXPECT_LT((doubt - probability * whole).cwiseAbs().maxCoeff(), 1e-6 * doubt.cwiseAbs().maxCoeff());
}

TEST(PriorScales, ThreePlacesHaveNoDoubtAsTheyReachToOne) {
  std::mt19937_64 random(2);
  const Drive drive(1.0, random);
  Vector9 truth = Vector9::Zero();
  truth.tail<6>() << 0.02, -0.01, 0.015, 0.0, -0.03, 0.01;
  PriorScales scales{SensorClass{}};
  ParameterVector x;
  ASSERT_TRUE(settle(drive, truth, Vector9::Zero(), scales, x));
  EXPECT_FALSE(scales.one_chip());
  EXPECT_EQ(scales.doubt(x, drive.per_slope(scales)), Covariance::Zero());
}

TEST(PriorScales, OddsThatTurnWithEachBeliefEndAtThreePlaces) {
  std::mt19937_64 random(4);
  const Drive drive(1.0, random);
  PriorScales scales{SensorClass{}};
  ParameterVector like_one = ParameterVector::Zero();
  ParameterVector like_three = ParameterVector::Zero();
  like_three.segment<6>(kPlaces).setConstant(0.02);
  const auto choose = [&](const ParameterVector& x) {
    scales.choose_places(x, drive.per_slope(scales));
    return scales.one_chip();
  };
  EXPECT_TRUE(choose(like_one));
  EXPECT_FALSE(choose(like_three));
  EXPECT_TRUE(choose(like_one)) << "the first may be of an estimate that has not settled";
  EXPECT_FALSE(choose(like_three));
  EXPECT_FALSE(choose(like_one));
  EXPECT_EQ(scales.precision()[kPlaces], std::pow(SensorClass{}.place_sd_m, -2));
}

// Three places of drives that tell them badly now and then look like one: the sd must still hold over all sensors.
TEST(PriorScales, LeverArmHoldsOverSensorsOfBothKindsWhereTheDriveTellsPlacesBadly) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  const SensorClass sensor;
  constexpr int kSensors = 4000;
  int taken_for_one = 0;
  double nees_of_taken = 0.0;
  double nees_without_doubt = 0.0;
  double sum = 0.0;
  int settled = 0;
  for (int i = 0; i < kSensors; ++i) {
    const bool three = i % 2 == 0;
    const Drive drive(0.3, random);
    Vector9 truth;
    for (double& value : truth) value = normal(random);
    truth.tail<6>() *= three ? sensor.place_sd_m : sensor.one_chip_place_sd_m;
    Vector9 noise;
    for (double& value : noise) value = normal(random);
    PriorScales scales(sensor);
    ParameterVector x;
    if (!settle(drive, truth, noise, scales, x)) continue;
    ++settled;
    const Covariance P = drive.per_slope(scales);
    const Covariance doubt = scales.doubt(x, P);
    const Eigen::Vector3d error = x.segment<3>(kLeverArm) - truth.head<3>();
    const auto nees = [&](const Covariance& of) {
      return error.dot(Eigen::Matrix3d(of.block<3, 3>(kLeverArm, kLeverArm)).llt().solve(error));
    };
    sum += nees(P + doubt);
    if (!three || !scales.one_chip()) continue;
    ++taken_for_one;
    nees_of_taken += nees(P + doubt);
    nees_without_doubt += nees(P);
  }
  EXPECT_GT(settled, kSensors * 99 / 100);
  EXPECT_GT(taken_for_one, 0);
  EXPECT_LT(taken_for_one,
            kSensors / 2 / 150 + 3 * 4);  // Markov's bound and three sd of a count of that size
  EXPECT_LT(nees_of_taken, nees_without_doubt);
  EXPECT_NEAR(sum / settled, 3.0, 0.15);  // 3.3 sd of the mean of as many chi-squares of 3 degrees: 0.13
}

}  // namespace
}  // namespace imuscope::batch
