#include "estimation/batch/quietest_rates.h"

#include <gtest/gtest.h>
#include <cmath>
#include <random>
#include <vector>

#include "estimation/batch/grid.h"

namespace imuscope::batch {
namespace {

using Rates = Eigen::Matrix<double, Eigen::Dynamic, 3>;

/// Rates of white noise alone; in the first part of the record with motion on top.
Rates rates_of(double white_radps_per_sqrt_hz, double minutes, double motion_radps, double moving_share,
               std::mt19937_64& random) {
  const auto n = static_cast<Eigen::Index>(60.0 * minutes * kGridRate_hz);
  std::normal_distribution<double> normal;
  Rates rates(n, 3);
  Eigen::RowVector3d motion = Eigen::RowVector3d::Zero();
  for (Eigen::Index i = 0; i < n; ++i) {
    const double sd = white_radps_per_sqrt_hz * std::sqrt(kGridRate_hz);
    rates.row(i) << sd * normal(random), sd * normal(random), sd * normal(random);
    if (static_cast<double>(i) >= moving_share * static_cast<double>(n)) continue;
    motion = 0.5 * motion + motion_radps * Eigen::RowVector3d(normal(random), normal(random), normal(random));
    rates.row(i) += motion;
  }
  return rates;
}

double quietest(const Rates& rates) {
  return quietest_gyro_white_radps_per_sqrt_hz(rates,
                                               std::vector<char>(static_cast<std::size_t>(rates.rows()), 1));
}

TEST(QuietestRates, AreThoseOfTheNoiseAndNotOfItsSmallestDraws) {
  std::mt19937_64 random(7);
  constexpr double kWhite = 3e-5;
  for (const double minutes : {3.0, 15.0, 40.0}) {
    constexpr int kRecords = 12;
    double sum = 0.0;
    for (int i = 0; i < kRecords; ++i)
      sum += quietest(rates_of(kWhite, minutes, 0.0, 0.0, random)) / kRecords;
    EXPECT_NEAR(sum / kWhite, 1.0, 0.05) << minutes << " min";
  }
}

TEST(QuietestRates, AreReadWhereTheVehicleIsQuiet) {
  std::mt19937_64 random(8);
  constexpr double kWhite = 3e-5;
  EXPECT_NEAR(quietest(rates_of(kWhite, 15.0, 0.01, 0.9, random)) / kWhite, 1.0, 0.1);
}

/// A car in town: ten stops of eight seconds in a quarter of an hour.
TEST(QuietestRates, AreReadAtTrafficLights) {
  std::mt19937_64 random(10);
  constexpr double kWhite = 3e-5;
  const Rates quiet = rates_of(kWhite, 15.0, 0.0, 0.0, random);
  Rates rates = rates_of(kWhite, 15.0, 0.01, 1.0, random);
  const auto stop = static_cast<Eigen::Index>(8.0 * kGridRate_hz);
  for (Eigen::Index i = 0; i < 10; ++i) {
    const Eigen::Index from = (4 * i + 1) * rates.rows() / 41;
    rates.middleRows(from, stop) = quiet.middleRows(from, stop);
  }
  EXPECT_NEAR(quietest(rates) / kWhite, 1.0, 0.15);
}

TEST(QuietestRates, AreWhatTheMotionAllowsWhereItNeverStops) {
  std::mt19937_64 random(9);
  EXPECT_GT(quietest(rates_of(0.0, 12.0, 0.01, 1.0, random)), 0.005 / std::sqrt(kGridRate_hz));
}

}  // namespace
}  // namespace imuscope::batch
