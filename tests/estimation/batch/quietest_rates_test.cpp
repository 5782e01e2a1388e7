#include "estimation/batch/quietest_rates.h"

#include <gtest/gtest.h>
#include <cmath>
#include <random>

#include "estimation/batch/grid.h"

namespace imuscope::batch {
namespace {

constexpr double kTop_hz = 20.0;

/// Rates of white noise alone; in the first nine tenths of the record with motion on top.
Problem problem_of(double white_radps_per_sqrt_hz, double minutes, double motion_radps,
                   std::mt19937_64& random) {
  const auto n = static_cast<Eigen::Index>(60.0 * minutes * kGridRate_hz);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd series = Eigen::MatrixXd::Zero(n, kReferenceColumns);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      series(i, kOmega + axis) = white_radps_per_sqrt_hz * std::sqrt(kGridRate_hz) * normal(random);
  }
  Eigen::RowVector3d motion = Eigen::RowVector3d::Zero();
  for (Eigen::Index i = 0; i < n * 9 / 10; ++i) {
    const Eigen::RowVector3d kick(normal(random), normal(random), normal(random));
    motion = 0.5 * motion + motion_radps * kick;
    series.middleCols<3>(kOmega).row(i) += motion;
  }
  Problem problem;
  problem.plan = plan_windows(std::vector<char>(static_cast<std::size_t>(n), 1), kGridRate_hz, kTop_hz);
  problem.bands = Bands(problem.plan.n_frequencies);
  problem.reference = Spectra(problem.plan, series);
  return problem;
}

TEST(QuietestRates, AreThoseOfTheNoiseAndNotOfItsSmallestDraws) {
  std::mt19937_64 random(7);
  constexpr double kWhite = 3e-5;
  for (const double minutes : {3.0, 15.0, 40.0}) {
    constexpr int kRecords = 12;
    double sum = 0.0;
    for (int i = 0; i < kRecords; ++i)
      sum += quietest_gyro_white_radps_per_sqrt_hz(problem_of(kWhite, minutes, 0.0, random)) / kRecords;
    EXPECT_NEAR(sum / kWhite, 1.0, 0.05) << minutes << " min";
  }
}

TEST(QuietestRates, AreReadWhereTheVehicleIsQuiet) {
  std::mt19937_64 random(8);
  constexpr double kWhite = 3e-5;
  EXPECT_NEAR(quietest_gyro_white_radps_per_sqrt_hz(problem_of(kWhite, 15.0, 0.01, random)) / kWhite, 1.0,
              0.1);
}

TEST(QuietestRates, AreWhatTheMotionAllowsWhereItNeverStops) {
  std::mt19937_64 random(9);
  Problem problem = problem_of(0.0, 15.0, 0.01, random);
  problem.plan.starts.resize(problem.plan.starts.size() * 8 / 10);
  EXPECT_GT(quietest_gyro_white_radps_per_sqrt_hz(problem), 0.005 / std::sqrt(kGridRate_hz));
}

}  // namespace
}  // namespace imuscope::batch
