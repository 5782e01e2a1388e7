#include "estimation/calibration/combine.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <random>

#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

const Matrix3d kCombinedMounting = exp_so3(Vector3d(0.3, -1.2, 2.0));
const Vector3d kLeverArm(0.35, -0.22, 0.12);

MountingEstimate estimate_of(const Vector6& error, const Matrix6& P) {
  MountingEstimate estimate;
  // C_true = C^ Exp(-psi), so C^ = C_true Exp(psi).
  estimate.C_b_s = to_array(Matrix3d(kCombinedMounting * exp_so3(error.head<3>())));
  estimate.r_bs_b_m = to_array(Vector3d(kLeverArm - error.tail<3>()));
  Eigen::Map<Matrix6>(estimate.covariance_psi_r.data()) = P;
  return estimate;
}

Vector6 error_of(const MountingEstimate& estimate) {
  Vector6 error;
  error.head<3>() = -log_so3(to_eigen(estimate.C_b_s).transpose() * kCombinedMounting);
  error.tail<3>() = kLeverArm - to_eigen(estimate.r_bs_b_m);
  return error;
}

Matrix6 covariance_with_sd(double psi, double r) {
  Matrix6 P = Matrix6::Zero();
  P.diagonal() << psi * psi, psi * psi, 4.0 * psi * psi, r * r, r * r, 9.0 * r * r;
  P(0, 4) = P(4, 0) = 0.5 * psi * r;
  return P;
}

Vector6 draw(std::mt19937_64& random, const Matrix6& P) {
  std::normal_distribution<double> normal;
  Vector6 white;
  for (Eigen::Index i = 0; i < 6; ++i) white(i) = normal(random);
  return P.llt().matrixL() * white;
}

TEST(Combine, IndependentDrivesGiveAConsistentMeanAndAnUnsuspiciousHomogeneity) {
  std::mt19937_64 random(31);
  constexpr int kCampaigns = 400;
  double nees = 0.0;
  double mean_chi2 = 0.0;
  int suspicious = 0;
  for (int c = 0; c < kCampaigns; ++c) {
    std::vector<MountingEstimate> drives;
    for (const double scale : {1.0, 2.0, 0.7}) {
      const Matrix6 P = covariance_with_sd(1e-4 * scale, 5e-4 * scale);
      drives.push_back(estimate_of(draw(random, P), P));
    }
    const auto combined = combine(drives, CombineMethod::kInverseVariance);
    ASSERT_TRUE(combined.has_value());
    const Eigen::Map<const Matrix6> P(combined->estimate.covariance_psi_r.data());
    const Vector6 error = error_of(combined->estimate);
    nees += error.dot(P.ldlt().solve(error));
    mean_chi2 += combined->homogeneity_chi2;
    EXPECT_EQ(combined->homogeneity_dof, 12U);
    suspicious += combined->homogeneity_p_value < 0.05 ? 1 : 0;
  }
  // Chi-square means and their sd; 4 sd. That a mounting repeats exactly is not known: the sd are a little
  // wider than where it is.
  EXPECT_LT(nees / kCampaigns, 6.0 + 4.0 * std::sqrt(12.0 / kCampaigns));
  EXPECT_GT(nees / kCampaigns, 4.0);
  EXPECT_NEAR(mean_chi2 / kCampaigns, 12.0, 4.0 * std::sqrt(24.0 / kCampaigns));
  EXPECT_NEAR(suspicious, 0.05 * kCampaigns, 4.0 * std::sqrt(0.05 * 0.95 * kCampaigns));
}

/// What lasts from drive to drive (a sensor's crooked axes) must not average out, nor make drives differ.
TEST(Combine, WhatDrivesShareStaysAndTheTestOfHomogeneityKnowsIt) {
  std::mt19937_64 random(33);
  std::normal_distribution<double> normal;
  constexpr int kCampaigns = 400;
  constexpr int kColumns = 4;
  constexpr double kShared = 3e-4;
  Eigen::Matrix<double, 6, kColumns, Eigen::RowMajor> pattern;
  for (Eigen::Index i = 0; i < pattern.size(); ++i) pattern.data()[i] = kShared * normal(random);
  double nees = 0.0;
  double mean_chi2 = 0.0;
  int suspicious = 0;
  for (int c = 0; c < kCampaigns; ++c) {
    Eigen::Matrix<double, kColumns, 1> lasting;
    for (auto& value : lasting) value = normal(random);
    std::vector<MountingEstimate> drives;
    for (const double scale : {1.0, 2.0, 0.7, 1.5}) {
      const Matrix6 own = covariance_with_sd(1e-4 * scale, 5e-4 * scale);
      // A drive that tells less leaves more of what was believed before.
      const Eigen::Matrix<double, 6, kColumns, Eigen::RowMajor> shared = (0.8 + 0.2 * scale) * pattern;
      const Matrix6 P = own + shared * shared.transpose();
      drives.push_back(estimate_of(draw(random, own) + shared * lasting, P));
      drives.back().shared_psi_r.assign(shared.data(), shared.data() + shared.size());
    }
    const auto combined = combine(drives, CombineMethod::kInverseVariance);
    ASSERT_TRUE(combined.has_value());
    const Eigen::Map<const Matrix6> P(combined->estimate.covariance_psi_r.data());
    const Vector6 error = error_of(combined->estimate);
    nees += error.dot(P.ldlt().solve(error));
    mean_chi2 += combined->homogeneity_chi2;
    suspicious += combined->homogeneity_p_value < 0.05 ? 1 : 0;
    for (const auto& drive : combined->drives) suspicious += drive.p_value < 1e-5 ? 100 : 0;
  }
  EXPECT_NEAR(nees / kCampaigns, 6.0, 4.0 * std::sqrt(12.0 / kCampaigns));
  EXPECT_NEAR(mean_chi2 / kCampaigns, 18.0, 4.0 * std::sqrt(36.0 / kCampaigns));
  EXPECT_NEAR(suspicious, 0.05 * kCampaigns, 4.0 * std::sqrt(0.05 * 0.95 * kCampaigns));
}

TEST(Combine, IntersectionOfTwiceTheSameDriveLearnsNothing) {
  const Matrix6 P = covariance_with_sd(1e-4, 5e-4);
  std::mt19937_64 random(32);
  const MountingEstimate drive = estimate_of(draw(random, P), P);
  const std::vector<MountingEstimate> drives{drive, drive};
  const auto combined = combine(drives, CombineMethod::kCovarianceIntersection);
  ASSERT_TRUE(combined.has_value());
  const Eigen::Map<const Matrix6> after(combined->estimate.covariance_psi_r.data());
  EXPECT_LT((after - P).norm(), 1e-9 * P.norm());
  EXPECT_NEAR(combined->weights[0] + combined->weights[1], 1.0, 1e-9);
}

TEST(Combine, IntersectionWeightsMinimiseTheVolume) {
  const Matrix6 a = covariance_with_sd(1e-4, 2e-3);
  const Matrix6 b = covariance_with_sd(4e-4, 5e-4);
  const std::vector<MountingEstimate> drives{estimate_of(Vector6::Zero(), a),
                                             estimate_of(Vector6::Zero(), b)};
  const auto combined = combine(drives, CombineMethod::kCovarianceIntersection);
  ASSERT_TRUE(combined.has_value());
  const auto log_det = [&](double w) {
    const Matrix6 scaled = w * a.inverse() + (1.0 - w) * b.inverse();
    return -std::log(scaled.determinant());
  };
  const double w = combined->weights[0];
  EXPECT_GT(w, 0.05);
  EXPECT_LT(w, 0.95);
  for (double other = 0.01; other < 1.0; other += 0.01) EXPECT_LE(log_det(w), log_det(other) + 1e-6);
}

TEST(Combine, AMovedMountShowsInTheTestOfHomogeneity) {
  const Matrix6 P = covariance_with_sd(1e-4, 5e-4);
  Vector6 moved = Vector6::Zero();
  moved(0) = 8e-4;
  const std::vector<MountingEstimate> drives{estimate_of(Vector6::Zero(), P), estimate_of(moved, P)};
  const auto combined = combine(drives, CombineMethod::kInverseVariance);
  ASSERT_TRUE(combined.has_value());
  EXPECT_LT(combined->homogeneity_p_value, 1e-4);
}

/// Plates that are screwed on anew: each drive has a mounting of its own about the one that lasts.
struct Campaign {
  int drives;
  double psi_sd_rad;
  double r_sd_m;
};

void PrintTo(const Campaign& c, std::ostream* out) {
  *out << c.drives << " drives, " << c.psi_sd_rad << " rad, " << c.r_sd_m << " m";
}

class Scatter : public testing::TestWithParam<Campaign> {};

TEST_P(Scatter, BetweenDrivesIsLearnedTheMeanIsHonestAndNoDriveLikeTheOthersStandsOut) {
  const Campaign& campaign = GetParam();
  std::mt19937_64 random(34);
  constexpr int kCampaigns = 100;
  double nees = 0.0;
  double square_psi = 0.0;
  int stand_out = 0;
  for (int c = 0; c < kCampaigns; ++c) {
    std::vector<MountingEstimate> drives;
    for (int i = 0; i < campaign.drives; ++i) {
      const Matrix6 own = covariance_with_sd(1e-4, 1e-4);
      Matrix6 between = Matrix6::Zero();
      between.diagonal().head<3>().setConstant(campaign.psi_sd_rad * campaign.psi_sd_rad);
      between.diagonal().tail<3>().setConstant(campaign.r_sd_m * campaign.r_sd_m);
      drives.push_back(estimate_of(draw(random, own + between), own));
    }
    const auto combined = combine(drives, CombineMethod::kInverseVariance);
    ASSERT_TRUE(combined.has_value());
    const Eigen::Map<const Matrix6> P(combined->estimate.covariance_psi_r.data());
    const Vector6 error = error_of(combined->estimate);
    nees += error.dot(P.ldlt().solve(error)) / kCampaigns;
    square_psi += std::pow(combined->between_drives_psi_sd_rad, 2) / kCampaigns;
    stand_out += combined->one_mounting_p_value() < 0.05 ? 1 : 0;
  }
  // Chi-square with its sd, 4 sd. Of three drives the size of the scatter is known to a third at best.
  EXPECT_NEAR(nees, 6.0, 1.5);
  const double psi_sd = std::sqrt(square_psi);
  if (campaign.psi_sd_rad > 0.0) {
    EXPECT_GT(psi_sd, 0.7 * campaign.psi_sd_rad);
    EXPECT_LT(psi_sd, 1.5 * campaign.psi_sd_rad);
  } else {
    EXPECT_LT(psi_sd, 5e-5);
  }
  EXPECT_LT(stand_out, 0.05 * kCampaigns + 4.0 * std::sqrt(0.05 * 0.95 * kCampaigns));
}

INSTANTIATE_TEST_SUITE_P(Combine, Scatter,
                         testing::Values(Campaign{3, 0.0, 0.0}, Campaign{3, 1e-3, 5e-4},
                                         Campaign{8, 1e-3, 5e-4}, Campaign{8, 0.0, 5e-4},
                                         Campaign{5, 2e-4, 1e-4}));

TEST(Combine, ASensorThatWasTakenOffStandsOutOfDrivesThatScatter) {
  std::mt19937_64 random(35);
  const Matrix6 own = covariance_with_sd(1e-4, 1e-4);
  Matrix6 between = Matrix6::Zero();
  between.diagonal().head<3>().setConstant(1e-6);
  between.diagonal().tail<3>().setConstant(1e-7);
  for (const int n : {2, 3, 6}) {
    std::vector<MountingEstimate> drives;
    for (int i = 0; i < n; ++i) drives.push_back(estimate_of(draw(random, own + between), own));
    Vector6 moved = Vector6::Zero();
    moved(2) = 2.0 / 57.3;
    drives.back() = estimate_of(moved, own);
    const auto combined = combine(drives, CombineMethod::kInverseVariance);
    ASSERT_TRUE(combined.has_value());
    EXPECT_LT(combined->one_mounting_p_value(), 1e-3) << n;
    EXPECT_LT(combined->drives.back().p_value, 1e-3) << n;
    if (n > 2) {
      EXPECT_GT(combined->drives.front().p_value, 0.01) << n;
    }
  }
}

TEST(Combine, RefusesNothingAndNamesABrokenCovariance) {
  EXPECT_FALSE(combine({}, CombineMethod::kInverseVariance).has_value());
  const std::vector<MountingEstimate> drives{estimate_of(Vector6::Zero(), covariance_with_sd(1e-4, 5e-4)),
                                             estimate_of(Vector6::Zero(), Matrix6(-Matrix6::Identity()))};
  const auto combined = combine(drives, CombineMethod::kInverseVariance);
  ASSERT_FALSE(combined.has_value());
  EXPECT_NE(combined.error().text().find("mounting 2"), std::string::npos);
}

TEST(Combine, OneDriveAloneIsItselfAndContradictsNothing) {
  const Matrix6 P = covariance_with_sd(1e-4, 5e-4);
  Vector6 error = Vector6::Zero();
  error(1) = 2e-4;
  const std::vector<MountingEstimate> drives{estimate_of(error, P)};
  for (const CombineMethod method :
       {CombineMethod::kInverseVariance, CombineMethod::kCovarianceIntersection}) {
    const auto combined = combine(drives, method);
    ASSERT_TRUE(combined.has_value());
    EXPECT_LT((error_of(combined->estimate) - error).norm(), 1e-12);
    const Eigen::Map<const Matrix6> combined_P(combined->estimate.covariance_psi_r.data());
    EXPECT_LT((combined_P - P).norm(), 1e-9 * P.norm());
    EXPECT_EQ(combined->homogeneity_dof, 0U);
    EXPECT_EQ(combined->homogeneity_p_value, 1.0);
    ASSERT_EQ(combined->drives.size(), 1U);
    EXPECT_EQ(combined->drives[0].p_value, 1.0);
  }
}

TEST(WeightedMean, ClaimsIndependentValues) {
  WeightedMean mean;
  EXPECT_EQ(mean.claimed_sd(), 0.0) << "of nothing";
  mean.add(1.0, 1.0);
  mean.add(4.0, 2.0);
  EXPECT_DOUBLE_EQ(mean.mean(), (1.0 + 4.0 / 4.0) / 1.25);
  EXPECT_DOUBLE_EQ(mean.claimed_sd(), 1.0 / std::sqrt(1.25));
}

}  // namespace
}  // namespace imuscope
