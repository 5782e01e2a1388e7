#include "regimes/motion_regimes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "firmware_sim/motion/motion.h"

namespace imuscope {
namespace {

constexpr double kRate_hz = 100.0;

HostTime host_time_at(double s) { return HostTime{} + from_seconds(1000.0 + s); }
Vector3 array_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

imusim::Motion drive(std::uint64_t seed, double duration_s) {
  imusim::Scenario scenario;
  scenario.duration_s = duration_s;
  scenario.seed = seed;
  return imusim::Motion(scenario);
}

/// Levels of a simulated drive with a reference of small noise, with or without a speed at 10 Hz.
MotionLevels levels_of(const imusim::Motion& motion, bool with_speed) {
  MotionLevels levels;
  std::mt19937 random(5);
  std::normal_distribution<double> force(0.0, 0.001);
  for (int k = 0; k < static_cast<int>(motion.duration_s() * kRate_hz); ++k) {
    const double t_s = k / kRate_hz;
    const auto state = motion.state_at(t_s);
    Vector3 f = array_of(state.f_b_mps2);
    for (double& axis : f) axis += force(random);
    levels.add(host_time_at(t_s), array_of(state.omega_ib_b_radps), f);
    if (with_speed && k % 10 == 0) levels.add_speed(host_time_at(t_s), state.v_n_mps.norm(), 0.01);
  }
  return levels;
}

/// Share of the time in which the track and the simulator's own regime differ.
double disagreement(const RegimeTrack& track, const imusim::Motion& motion) {
  int differ = 0;
  int n = 0;
  for (double t_s = 0.05; t_s < motion.duration_s(); t_s += 0.1) {
    const auto found = track.at(host_time_at(t_s));
    const bool is_static = motion.regime_at(t_s) == imusim::Regime::kStatic;
    differ += found && (*found == 0) == is_static ? 0 : 1;
    ++n;
  }
  return static_cast<double>(differ) / n;
}

class SimulatedDrives : public ::testing::TestWithParam<bool> {};

TEST_P(SimulatedDrives, StaticAndDynamicAreFoundAndShortStopsBelongToTheDrive) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const auto motion = drive(seed, 600.0);
    MotionLimits limits;
    limits.shortest_static_s = 30.0;
    const auto track = static_and_dynamic(levels_of(motion, GetParam()), limits);
    EXPECT_EQ(track.names(), (std::vector<std::string>{"static", "dynamic"}));
    // Each of the two changes may be noticed 3 s off, half the window of the mean.
    EXPECT_LT(disagreement(track, motion), 2.0 * 3.0 / 600.0) << "seed " << seed;
    EXPECT_EQ(track.stretches().size(), 3u) << "standstill, drive, standstill";
  }
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutSpeed, SimulatedDrives, ::testing::Bool());

TEST(StaticAndDynamic, ADriveWithoutAStandstillHasNoStaticPartAndARecordAtRestNoDynamicOne) {
  MotionLevels moving;
  MotionLevels resting;
  for (int k = 0; k < 6000; ++k) {
    const double t_s = k / kRate_hz;
    moving.add(host_time_at(t_s), {0.0, 0.0, 0.1 * std::sin(t_s)}, {std::sin(0.7 * t_s), 0.0, -9.81});
    resting.add(host_time_at(t_s), {0.0, 0.0, 5e-5}, {0.0, 0.0, -9.81});
  }
  const auto drive_track = static_and_dynamic(moving, {});
  EXPECT_EQ(drive_track.total_s(0), 0.0);
  EXPECT_NEAR(drive_track.total_s(1), 60.0, 0.21);
  const auto rest_track = static_and_dynamic(resting, {});
  EXPECT_NEAR(rest_track.total_s(0), 60.0, 0.21);
  EXPECT_EQ(rest_track.total_s(1), 0.0);
}

TEST(StaticAndDynamic, BetweenTheLimitsTheRegimeStays) {
  // A speed that goes up and down between the limit for rest and that for motion changes nothing; beyond it
  // does.
  const auto track_of = [](double top_mps) {
    MotionLevels levels;
    for (int k = 0; k < 12'000; ++k) {
      const double t_s = k / kRate_hz;
      levels.add(host_time_at(t_s), {}, {0.0, 0.0, -9.81});
      if (k % 10 == 0) levels.add_speed(host_time_at(t_s), t_s > 40.0 && t_s < 80.0 ? top_mps : 0.0, 0.001);
    }
    return static_and_dynamic(levels, {});
  };
  EXPECT_EQ(track_of(0.25).stretches().size(), 1u);
  const auto moved = track_of(0.35);
  ASSERT_EQ(moved.stretches().size(), 3u);
  EXPECT_NEAR(to_seconds(moved.stretches()[1].begin - host_time_at(0.0)), 40.0, 0.41);
  EXPECT_NEAR(to_seconds(moved.stretches()[1].end - host_time_at(0.0)), 80.0, 0.41);
}

TEST(StaticAndDynamic, AVehicleThatStandsByItsSpeedMayShake) {
  const auto dynamic_s = [](bool with_speed) {
    MotionLevels levels;
    std::mt19937 random(3);
    std::normal_distribution<double> engine(0.0,
                                            0.5);  // per axis: 0.87 m/s^2 rms, above the limit for motion
    for (int k = 0; k < 6000; ++k) {
      const double t_s = k / kRate_hz;
      levels.add(host_time_at(t_s), {}, {engine(random), engine(random), engine(random) - 9.81});
      if (with_speed && k % 10 == 0) levels.add_speed(host_time_at(t_s), 0.0, 0.01);
    }
    return static_and_dynamic(levels, {}).total_s(1);
  };
  EXPECT_GT(dynamic_s(false), 59.0);
  EXPECT_LT(dynamic_s(true), 1.0);
}

TEST(IntensityBins, BlocksAreSplitAtTheQuantilesOfTheirRate) {
  // One minute of rest, then three of rising yaw rate.
  MotionLevels levels;
  for (int k = 0; k < 24'000; ++k) {
    const double t_s = k / kRate_hz;
    const double size = t_s < 60.0 ? 0.0 : 0.05 * std::floor(t_s / 60.0);
    levels.add(host_time_at(t_s), {0.0, 0.0, size * std::sin(3.0 * t_s)},
               {size * std::cos(2.0 * t_s), 0.0, -9.81});
    if (k % 10 == 0) levels.add_speed(host_time_at(t_s), t_s < 60.0 ? 0.0 : 10.0, 0.01);
  }
  const auto motion = static_and_dynamic(levels, {});
  const auto bins = intensity_bins(levels, motion, Intensity::kRate, 3, 10.0);
  ASSERT_EQ(bins.names(),
            (std::vector<std::string>{"static", "intensity 1 of 3", "intensity 2 of 3", "intensity 3 of 3"}));
  EXPECT_EQ(bins.at(host_time_at(30.0)), 0u);
  EXPECT_EQ(bins.at(host_time_at(85.0)), 1u);
  EXPECT_EQ(bins.at(host_time_at(150.0)), 2u);
  EXPECT_EQ(bins.at(host_time_at(220.0)), 3u);
  for (std::size_t k = 1; k <= 3; ++k) EXPECT_NEAR(bins.total_s(k), 60.0, 11.0);
}

}  // namespace
}  // namespace imuscope
