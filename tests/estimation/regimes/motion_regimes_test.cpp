#include "estimation/regimes/motion_regimes.h"

#include <gtest/gtest.h>

#include <algorithm>
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

class SimulatedDrives : public ::testing::TestWithParam<bool> {};

TEST_P(SimulatedDrives, RestIsFoundAtEveryLightAndHoldsNoMotion) {
  int rest = 0;
  int found = 0;
  int motion_in_static = 0;
  int rest_in_dynamic = 0;
  int dynamic = 0;
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u, 6u}) {
    const auto motion = drive(seed, 600.0);
    const auto track = static_and_dynamic(levels_of(motion, GetParam()), {});
    EXPECT_EQ(track.names(), (std::vector<std::string>{"static", "dynamic"}));
    for (double t_s = 0.05; t_s < motion.duration_s(); t_s += 0.1) {
      const bool stands = motion.regime_at(t_s) == imusim::Regime::kStatic;
      const auto named = track.at(host_time_at(t_s));
      rest += stands ? 1 : 0;
      found += stands && named == 0u ? 1 : 0;
      motion_in_static += !stands && named == 0u ? 1 : 0;
      rest_in_dynamic += stands && named == 1u ? 1 : 0;
      dynamic += named == 1u ? 1 : 0;
    }
  }
  // The guards take 0.6 s of each stop; a mixture of a thousandth is no mixture.
  EXPECT_GE(found, 0.95 * rest);
  EXPECT_LE(motion_in_static, 0.001 * found);
  EXPECT_LE(rest_in_dynamic, 0.001 * dynamic);
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

TEST(StaticAndDynamic, MotionReachesBackToTheLastRestOverAHoleOfTheReference) {
  // Stands for 40 s, creeps between the limits for 2 s, 3 s are missing, drives.
  MotionLevels levels;
  for (int k = 0; k < 8000; ++k) {
    const double t_s = k / kRate_hz;
    if (t_s >= 42.0 && t_s < 45.0) continue;
    levels.add(host_time_at(t_s), {}, {0.0, 0.0, -9.81});
    if (k % 10 == 0) levels.add_speed(host_time_at(t_s), t_s < 40.0 ? 0.0 : t_s < 42.0 ? 0.25 : 5.0, 0.001);
  }
  const auto track = static_and_dynamic(levels, {});
  ASSERT_EQ(track.stretches().size(), 2u);
  const double guard_s = MotionLimits{}.guard_s;
  EXPECT_NEAR(to_seconds(track.stretches()[0].end - host_time_at(0.0)), 40.0 - guard_s, 0.11);
  EXPECT_NEAR(to_seconds(track.stretches()[1].begin - host_time_at(0.0)), 40.0 + guard_s, 0.11);
}

TEST(StaticAndDynamic, AHoleOfTheReferenceGoesOnWithTheRegimeBeforeIt) {
  MotionLevels levels;
  for (int k = 0; k < 8000; ++k) {
    const double t_s = k / kRate_hz;
    if ((t_s >= 15.0 && t_s < 25.0) || (t_s >= 55.0 && t_s < 65.0)) continue;
    const double size = t_s < 40.0 ? 0.0 : 1.0;
    levels.add(host_time_at(t_s), {0.0, 0.0, size * 0.2 * std::sin(t_s)},
               {size * std::sin(0.7 * t_s), 0.0, -9.81});
  }
  const auto track = static_and_dynamic(levels, {});
  EXPECT_EQ(track.at(host_time_at(20.0)), 0u);
  EXPECT_EQ(track.at(host_time_at(60.0)), 1u);
  EXPECT_EQ(track.stretches().size(), 2u);
}

TEST(MotionLevels, SamplesMayComeInAnyOrderAndBeforeTheOriginOfTheTimeScale) {
  struct Sample {
    HostTime time;
    double rate_radps;
  };
  std::vector<Sample> samples;
  for (int k = -245; k < 245; ++k) samples.push_back({HostTime{} + from_seconds(k / kRate_hz), 0.01 * k});
  MotionLevels ordered;
  for (const auto& s : samples) ordered.add(s.time, {s.rate_radps, 0.0, 0.0}, {});
  std::shuffle(samples.begin(), samples.end(), std::mt19937(4));
  MotionLevels shuffled;
  for (const auto& s : samples) shuffled.add(s.time, {s.rate_radps, 0.0, 0.0}, {});
  const auto cells = ordered.cells();
  const auto same = shuffled.cells();
  ASSERT_EQ(cells.size(), 50u);
  ASSERT_EQ(same.size(), cells.size());
  EXPECT_EQ(ordered.begin_of(0), HostTime{} + from_seconds(-2.5));
  EXPECT_EQ(shuffled.begin_of(0), ordered.begin_of(0));
  // The first and the last cell are half full; a full one holds 10 samples, of which the mean is known.
  EXPECT_EQ(cells.front().n, 5u);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    EXPECT_EQ(same[i].n, cells[i].n);
    const double first = std::max(-245.0, -250.0 + 10.0 * static_cast<double>(i));
    const double last = first + static_cast<double>(cells[i].n) - 1.0;
    EXPECT_NEAR(cells[i].omega_radps[0], 0.01 * 0.5 * (first + last), 1e-12) << i;
    EXPECT_NEAR(same[i].omega_radps[0], cells[i].omega_radps[0], 1e-12) << i;
    EXPECT_NEAR(same[i].rate_rms_radps, cells[i].rate_rms_radps, 1e-12) << i;
    // Of n numbers in steps of 0.01.
    const auto n = static_cast<double>(cells[i].n);
    EXPECT_NEAR(cells[i].rate_scatter_radps, 0.01 * std::sqrt(n * (n + 1.0) / 12.0), 1e-12) << i;
    EXPECT_NEAR(same[i].rate_scatter_radps, cells[i].rate_scatter_radps, 1e-12) << i;
  }
}

TEST(MotionLevels, ASpeedHoldsForASecondAndNoLonger) {
  MotionLevels levels;
  for (int k = 0; k < 500; ++k) levels.add(host_time_at(k / kRate_hz), {}, {});
  levels.add_speed(host_time_at(1.0), -7.0, 0.3);
  const auto cells = levels.cells();
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const double begin_s = MotionLevels::kCell_s * static_cast<double>(i);
    const bool holds = begin_s > 0.95 && begin_s < 2.05;
    EXPECT_EQ(cells[i].speed_mps.has_value(), holds) << begin_s;
    if (!holds) continue;
    EXPECT_EQ(*cells[i].speed_mps, 7.0) << "backwards is motion, too";
    EXPECT_EQ(cells[i].speed_sd_mps, 0.3);
  }
}

constexpr double kBlock_s = 10.0;

/// A drive whose blocks of ten seconds have the measures given, after half a minute of rest; a measure of
/// zero is rest. Rate, vibration and speed all have the block's measure.
struct BlockedDrive {
  explicit BlockedDrive(const std::vector<double>& measures, bool with_speed = true) {
    std::vector<RegimeStretch> stretches{{host_time_at(0.0), begin(0), 0}};
    for (std::size_t block = 0; block < measures.size(); ++block) {
      stretches.push_back({begin(block), begin(block + 1), measures[block] > 0.0 ? 1u : 0u});
      for (int k = 0; k < static_cast<int>(kBlock_s * kRate_hz); ++k) {
        const HostTime time = begin(block) + from_seconds(k / kRate_hz);
        // Of twenty samples about their mean the rms is greater than their size by this.
        const double size = measures[block] * std::sqrt(19.0 / 20.0);
        levels.add(time, {measures[block], 0.0, 0.0}, {k % 2 == 0 ? size : -size, 0.0, 0.0});
        if (with_speed && k % 10 == 0) levels.add_speed(time, measures[block], 0.01);
      }
    }
    motion = RegimeTrack({kStaticName, kDynamicName}, stretches);
  }
  static HostTime begin(std::size_t block) {
    return host_time_at(30.0 + kBlock_s * static_cast<double>(block));
  }
  [[nodiscard]] std::vector<std::optional<std::size_t>> bins(Intensity intensity, int n) const {
    const auto track = intensity_bins(levels, motion, intensity, n, kBlock_s);
    std::vector<std::optional<std::size_t>> found;
    for (HostTime t = begin(0) + from_seconds(0.5 * kBlock_s); t < motion.stretches().back().end;
         t += from_seconds(kBlock_s))
      found.push_back(track.at(t));
    return found;
  }
  MotionLevels levels;
  RegimeTrack motion;
};

using Bins = std::vector<std::optional<std::size_t>>;

TEST(IntensityBins, RateVibrationAndSpeedSplitADriveAlikeWhereTheyAreAlike) {
  const BlockedDrive drive({1.0, 5.0, 1.1, 5.5, 0.0, 5.2, 0.9});
  const Bins expected{1, 2, 1, 2, 0, 2, 1};
  for (const Intensity intensity : {Intensity::kRate, Intensity::kVibration, Intensity::kSpeed})
    EXPECT_EQ(drive.bins(intensity, 2), expected) << static_cast<int>(intensity);
}

TEST(IntensityBins, ABlockThatIsNotClearOfTheEdgeStaysInTheBinBeforeItExceptAfterAStandstill) {
  // The edge is 2: half of the blocks lie below it.
  const BlockedDrive drive({1.0, 2.02, 1.0, 3.0, 1.98, 3.0, 1.0, 0.0, 2.02, 3.0, 0.0, 1.0, 1.0, 3.0});
  EXPECT_EQ(drive.bins(Intensity::kRate, 2), (Bins{1, 1, 1, 2, 2, 2, 1, 0, 2, 2, 0, 1, 1, 2}));
}

TEST(IntensityBins, AJumpOverOneEdgeEndsBeforeTheNextThatItIsNotClearOf) {
  // Edges are 2 and 4.
  const BlockedDrive drive({1.0, 4.1, 1.0, 6.0, 3.9, 6.0, 1.0, 3.0, 3.0});
  EXPECT_EQ(drive.bins(Intensity::kRate, 3), (Bins{1, 2, 1, 3, 3, 3, 1, 2, 2}));
  // 2 and 5.25.
  const BlockedDrive down({6.0, 1.95, 6.0, 2.05, 6.5, 4.5, 1.0, 1.0, 3.5});
  EXPECT_EQ(down.bins(Intensity::kRate, 3), (Bins{3, 2, 3, 2, 3, 2, 1, 1, 2}));
}

TEST(IntensityBins, WithoutASpeedNoBlockHasABinOfIt) {
  const BlockedDrive drive({1.0, 0.0, 5.0}, false);
  EXPECT_EQ(drive.bins(Intensity::kSpeed, 2), (Bins{std::nullopt, 0, std::nullopt}));
  EXPECT_EQ(drive.bins(Intensity::kRate, 2), (Bins{1, 0, 2}));
}

TEST(IntensityBins, MoreBinsThanBlocksLeaveNoBlockWithoutOne) {
  for (const auto& bin : BlockedDrive({3.0}).bins(Intensity::kRate, 5)) {
    ASSERT_TRUE(bin);
    EXPECT_GE(*bin, 1u);
    EXPECT_LE(*bin, 5u);
  }
}

TEST(MotionLevels, ATimeThatNoDriveHasTakesNoMemory) {
  MotionLevels levels;
  const HostTime begin = host_time_from_ns(5'000'000'000);
  levels.add(begin, {}, {});
  levels.add(begin + std::chrono::hours(24 * 365 * 100), {}, {});
  levels.add_speed(begin - std::chrono::hours(24 * 365 * 100), 1.0, 0.1);
  EXPECT_EQ(levels.cells().size(), 1U);
  levels.add(begin + std::chrono::hours(95), {}, {});
  levels.add(begin - std::chrono::hours(2), {}, {});
  EXPECT_EQ(levels.cells().size(), 95U * 3600U * 10U + 1U) << "the earlier one would make it longer than any";
}

}  // namespace
}  // namespace imuscope
