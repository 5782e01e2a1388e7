#include "estimation/batch/grid.h"

#include <gtest/gtest.h>
#include <cmath>

namespace {

using imuscope::batch::Grid;
using imuscope::batch::ImuRecord;
using imuscope::batch::make_grid;

constexpr double kTwoPi = 6.283185307179586;

ImuRecord sine(double rate_hz, double f_hz, double jitter_s = 0.0) {
  ImuRecord record;
  for (int i = 0; i < static_cast<int>(8.0 * rate_hz); ++i) {
    const double t = i / rate_hz + jitter_s * std::sin(1.7 * i);
    const auto value = static_cast<float>(std::sin(kTwoPi * f_hz * t));
    record.add(t, {value, 0.0F, 1.0F}, {0.0F, 2.0F * value, -9.81F});
  }
  return record;
}

std::vector<double> instants() {
  std::vector<double> times;
  for (int i = 0; i < 200; ++i) times.push_back(2.0 + i / 50.0);
  return times;
}

TEST(Grid, LeavesSlowMotionAndItsDerivativeAsTheyAreWhateverTheRateAndTheJitter) {
  for (const double rate_hz : {100.0, 120.0, 400.0}) {
    const Grid grid = make_grid(sine(rate_hz, 1.5, 0.1 / rate_hz), instants(), true);
    for (Eigen::Index i = 0; i < grid.motion.rows(); ++i) {
      const double phase = kTwoPi * 1.5 * instants()[static_cast<std::size_t>(i)];
      ASSERT_EQ(grid.valid[static_cast<std::size_t>(i)], 1);
      EXPECT_NEAR(grid.motion(i, 0), std::sin(phase), 2e-3);
      EXPECT_NEAR(grid.motion(i, 4), 2.0 * std::sin(phase), 4e-3);
      EXPECT_NEAR(grid.omega_dot(i, 0), kTwoPi * 1.5 * std::cos(phase), 4e-2);
      EXPECT_NEAR(grid.motion(i, 2), 1.0, 1e-6);
      EXPECT_NEAR(grid.omega_dot(i, 2), 0.0, 1e-5);
    }
  }
}

TEST(Grid, TakesAwayWhatTheGridCouldNotShow) {
  const Grid grid = make_grid(sine(200.0, 30.0), instants(), false);
  EXPECT_LT(grid.motion.col(0).cwiseAbs().maxCoeff(), 5e-3);
}

TEST(Grid, ShowsTheSquareOfWhatItDoesNotShow) {
  const Grid grid = make_grid(sine(200.0, 30.0), instants(), true);
  for (Eigen::Index i = 0; i < grid.products.rows(); ++i) {
    EXPECT_NEAR(grid.products(i, 0), 0.5, 1e-2);  // omega_x^2
    EXPECT_NEAR(grid.products(i, 2), 1.0, 1e-6);  // omega_z^2
  }
}

TEST(Grid, BridgesTwoLostSamplesAndMarksALongerGap) {
  const ImuRecord whole = sine(100.0, 1.0);
  ImuRecord holed;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const bool lost_two = i == 300 || i == 301;
    const bool lost_ten = i >= 450 && i < 460;
    if (!lost_two && !lost_ten) holed.add(whole.time_s[i], whole.omega_radps[i], whole.f_mps2[i]);
  }
  const Grid grid = make_grid(holed, instants(), false);
  const Grid expected = make_grid(whole, instants(), false);
  for (Eigen::Index i = 0; i < grid.motion.rows(); ++i) {
    const double t = instants()[static_cast<std::size_t>(i)];
    // The gap lies between the samples at 4.49 and 4.60 s.
    const bool beside_gap = t > 4.49 - 0.25 && t < 4.60 + 0.25;
    // Where the kernel has come to nothing, either will do.
    const bool at_its_end = std::abs(t - (4.49 - 0.25)) < 0.13 || std::abs(t - (4.60 + 0.25)) < 0.13;
    if (!at_its_end) {
      EXPECT_EQ(grid.valid[static_cast<std::size_t>(i)] != 0, !beside_gap) << t;
    }
    if (grid.valid[static_cast<std::size_t>(i)] != 0) {
      EXPECT_NEAR(grid.motion(i, 0), expected.motion(i, 0), 0.03) << t;
    }
  }
}

TEST(Grid, HasNothingToSayBeyondTheRecord) {
  const Grid grid = make_grid(sine(100.0, 1.0), {-1.0, 0.1, 4.0, 7.95, 9.0}, false);
  EXPECT_EQ(grid.valid, (std::vector<char>{0, 0, 1, 0, 0}));
}

/// What the kernel of B-1 leaves of an amplitude, by its integral.
double low_pass_gain(double f_hz) {
  using namespace imuscope::batch;
  constexpr int kSteps = 500;
  double sum = 0.5;
  double weight = 0.5;
  for (int i = 1; i < kSteps; ++i) {
    const double t = kKernelHalf_s * i / kSteps;
    const double phase = kTwoPi * kLowPass_hz * t;
    const double k = std::sin(phase) / phase * std::pow(std::cos(0.25 * kTwoPi * t / kKernelHalf_s), 2);
    sum += k * std::cos(kTwoPi * f_hz * t);
    weight += k;
  }
  return sum / weight;
}

TEST(Grid, LowPassLeavesOfASineWhatItsGainSays) {
  for (const double f_hz : {0.5, 3.0, 8.0, 12.0}) {
    imuscope::batch::ImuRecord record;
    for (int i = 0; i < 1000; ++i) {
      const double t = i / 200.0;
      record.add(t, {static_cast<float>(std::sin(kTwoPi * f_hz * t)), 0.0F, 0.0F}, {0.0F, 0.0F, -9.81F});
    }
    std::vector<double> instants;
    for (int i = 0; i < 200; ++i) instants.push_back(1.0 + i / 67.0);
    const auto grid = imuscope::batch::make_grid(record, instants, false);
    for (std::size_t i = 0; i < instants.size(); ++i) {
      EXPECT_NEAR(grid.motion(static_cast<Eigen::Index>(i), 0),
                  low_pass_gain(f_hz) * std::sin(kTwoPi * f_hz * instants[i]), 1e-3);
    }
  }
}

}  // namespace
