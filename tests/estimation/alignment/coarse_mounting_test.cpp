#include "estimation/alignment/coarse_mounting.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <random>

#include "base/units.h"
#include "tests/estimation/alignment/analytic_motion.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The 24 ways to put a box on a table, and some that are crooked.
std::vector<Matrix3d> mountings() {
  std::vector<Matrix3d> out;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      if (a == b) continue;
      for (const double sa : {1.0, -1.0}) {
        for (const double sb : {1.0, -1.0}) {
          const Vector3d x = sa * Vector3d::Unit(a);
          const Vector3d y = sb * Vector3d::Unit(b);
          Matrix3d C;
          C << x, y, x.cross(y);
          out.push_back(C);
        }
      }
    }
  }
  std::mt19937 random(5);
  std::normal_distribution<> normal;
  for (int i = 0; i < 26; ++i) {
    Eigen::Quaterniond q{normal(random), normal(random), normal(random), normal(random)};
    out.push_back(q.normalized().toRotationMatrix());
  }
  return out;
}

/// An MTx-like sensor: noise, biases and lever arm of the navigation sheet's simulated study.
struct PairedImu {
  Matrix3d C_b_s = Matrix3d::Identity();
  Vector3d gyro_bias = Vector3d(0.005, -0.004, 0.006);
  Vector3d accel_bias = Vector3d(0.05, -0.04, 0.05);
  Vector3d r_b = Vector3d(0.35, -0.22, 0.12);
  double gyro_noise = 0.8 * kRadPerDeg;
  double accel_noise = 0.15;
};

void drive(CoarseMountingEstimator& estimator, const PairedImu& imu, double seconds, unsigned seed,
           double study_delay_s = 0.0, double motion = 1.0) {
  const test::SineSum rates = test::car_rates(seed);
  const test::SineSum forces = test::car_forces(seed);
  const Vector3d gravity(0.0, 0.0, -9.81);
  std::mt19937 random(seed);
  std::normal_distribution<> normal;
  const auto noise = [&](double sd) {
    return Vector3d{sd * normal(random), sd * normal(random), sd * normal(random)};
  };
  for (double t = 0.0; t < seconds; t += 0.01) {
    const double ts = t - study_delay_s;
    const Vector3d w = motion * rates(ts);
    const Vector3d w_dot = motion * rates.derivative(ts, 1);
    const Vector3d f = gravity + motion * (forces(ts) - gravity);
    const Vector3d f_at_s = f + w_dot.cross(imu.r_b) + w.cross(w.cross(imu.r_b));
    estimator.add(motion * rates(t), gravity + motion * (forces(t) - gravity),
                  imu.C_b_s * w + imu.gyro_bias + noise(imu.gyro_noise),
                  imu.C_b_s * f_at_s + imu.accel_bias + noise(imu.accel_noise));
  }
}

/// psi of C = C^ Exp(-psi).
Vector3d boresight_error(const Matrix3d& estimate, const Matrix3d& truth) {
  const Eigen::AngleAxisd turn(Matrix3d(estimate.transpose() * truth));
  return -turn.angle() * turn.axis();
}

TEST(CoarseMounting, FindsAnyMountingWithinTwoDegreesInAMinuteOfDriving) {
  unsigned seed = 100;
  for (const Matrix3d& C : mountings()) {
    PairedImu imu;
    imu.C_b_s = C;
    CoarseMountingEstimator estimator;
    drive(estimator, imu, 60.0, seed++);
    CoarseMounting out;
    ASSERT_EQ(estimator.solve(out), MountingResult::kOk) << "\n" << C;
    EXPECT_LT(boresight_error(out.C_b_s, C).norm(), 2.0 * kRadPerDeg) << "\n" << C;
    EXPECT_NEAR(out.C_b_s.determinant(), 1.0, 1e-12);
    EXPECT_LT((out.gyro_bias_s_radps - imu.gyro_bias).norm(), 1e-3);
  }
}

TEST(CoarseMounting, ItsCovarianceIsNotOptimistic) {
  // Biases drawn from what the options say; the mean normalised squared error must not exceed 3 by more than
  // its own spread (50 draws of chi-square 3: sd of the mean 0.35).
  std::mt19937 random(9);
  std::normal_distribution<> normal;
  double sum = 0.0;
  const std::vector<Matrix3d> all = mountings();
  for (std::size_t i = 0; i < all.size(); ++i) {
    PairedImu imu;
    imu.C_b_s = all[i];
    imu.accel_bias = 0.15 * Vector3d{normal(random), normal(random), normal(random)};
    CoarseMountingEstimator estimator;
    drive(estimator, imu, 60.0, 300 + static_cast<unsigned>(i));
    CoarseMounting out;
    ASSERT_EQ(estimator.solve(out), MountingResult::kOk);
    const Vector3d psi = boresight_error(out.C_b_s, imu.C_b_s);
    sum += psi.dot(out.covariance_rad2.inverse() * psi);
  }
  EXPECT_LT(sum / static_cast<double>(all.size()), 3.0 + 2.0 * 0.35);
}

TEST(CoarseMounting, AtRestItSaysThatTheAngleAboutGravityIsUnknown) {
  PairedImu imu;
  imu.C_b_s = Eigen::AngleAxisd(1.0, Vector3d(0.3, -0.5, 0.8).normalized()).toRotationMatrix();
  CoarseMountingEstimator estimator;
  drive(estimator, imu, 60.0, 7, 0.0, 0.0);
  CoarseMounting out;
  EXPECT_EQ(estimator.solve(out), MountingResult::kTooLittleExcitation);
  const Vector3d down = Vector3d::UnitZ();
  EXPECT_GT(std::sqrt(down.dot(out.covariance_rad2 * down)), 1.0);
  EXPECT_LT(std::sqrt(out.covariance_rad2(0, 0)), 0.02);
  // What gravity shows is right all the same.
  EXPECT_LT((out.C_b_s * down - imu.C_b_s * down).norm(), 0.02);
}

TEST(CoarseMounting, AMirroredTriadIsCalledInconsistent) {
  PairedImu imu;
  imu.C_b_s = -Matrix3d::Identity();  // all three axes flipped: no rotation does that
  CoarseMountingEstimator flipped;
  drive(flipped, imu, 60.0, 11);
  CoarseMounting out;
  EXPECT_EQ(flipped.solve(out), MountingResult::kInconsistent);
  imu.C_b_s = Vector3d(1.0, -1.0, 1.0).asDiagonal();
  CoarseMountingEstimator one_axis;
  drive(one_axis, imu, 60.0, 12);
  EXPECT_EQ(one_axis.solve(out), MountingResult::kInconsistent);
}

TEST(CoarseMounting, AWrongTimeOffsetOfSecondsNeverPassesAsGood) {
  PairedImu imu;
  CoarseMountingEstimator estimator;
  drive(estimator, imu, 60.0, 13, 7.0);
  CoarseMounting out;
  EXPECT_NE(estimator.solve(out), MountingResult::kOk);
}

TEST(CoarseMounting, IgnoresWhatIsNotANumberAndAsksForEnoughPairs) {
  CoarseMountingEstimator estimator;
  const Vector3d bad = Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  estimator.add(bad, Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero());
  EXPECT_EQ(estimator.pairs(), 0);
  CoarseMounting out;
  EXPECT_EQ(estimator.solve(out), MountingResult::kTooFewPairs);
}

}  // namespace
}  // namespace imuscope
