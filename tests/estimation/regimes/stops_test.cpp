#include <gtest/gtest.h>

#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <string>

#include "estimation/regimes/motion_regimes.h"
#include "estimation/regimes/recent_regimes.h"
#include "stopping_drive.h"

namespace imuscope {
namespace {

HostTime at_second(double s) { return HostTime{} + from_seconds(1000.0 + s); }

struct Score {
  int stops = 0;
  int found = 0;
  int at_rest = 0;
  int rest_right = 0;
  int in_motion = 0;
  int motion_right = 0;
};

/// Away from every change by so much, a regime has to be the true one.
constexpr double kAway_s = 0.3;

using RegimeAt = std::function<std::optional<std::size_t>(HostTime)>;

void add(const test::Driven& driven, const RegimeAt& regime_at, Score& score) {
  constexpr std::size_t kStatic = 0;
  constexpr std::size_t kDynamic = 1;
  for (std::size_t k = 0; k < driven.stops.size(); ++k) {
    const auto& stop = driven.stops[k];
    bool found = false;
    for (double t = stop.begin_s; t < stop.end_s; t += 0.05) found |= regime_at(at_second(t)) == kStatic;
    ++score.stops;
    score.found += found ? 1 : 0;
    const double begin_s = k > 0 ? stop.begin_s + kAway_s : 0.0;
    for (double t = begin_s; t < stop.end_s - kAway_s; t += 0.05) {
      ++score.at_rest;
      score.rest_right += regime_at(at_second(t)) == kStatic ? 1 : 0;
    }
    if (k + 1 == driven.stops.size()) continue;
    for (double t = stop.end_s + kAway_s; t < driven.stops[k + 1].begin_s - kAway_s; t += 0.05) {
      ++score.in_motion;
      score.motion_right += regime_at(at_second(t)) == kDynamic ? 1 : 0;
    }
  }
}

struct Goal {
  double stops_percent;
  double rest_percent;
  double motion_percent;
};

struct World {
  const char* name;
  bool engine_runs;
  double gyro_deg_per_s_sqrt_hz;
  double accel_mps2_sqrt_hz;
  Goal goal;
  bool has_speed;
};

class Stops : public testing::TestWithParam<World> {};

/// While the run goes on: what each sample was said to belong to once that was settled.
std::map<HostTime, std::optional<std::size_t>> settled_regimes(const test::Driven& driven) {
  std::map<HostTime, std::optional<std::size_t>> regimes;
  RecentRegimes recent({});
  std::size_t next = 0;
  const auto take = [&] {
    const auto until = recent.settled_until();
    for (; until && next < driven.samples.size() && driven.samples[next].time < *until; ++next)
      regimes.emplace(driven.samples[next].time, recent.at(driven.samples[next].time));
  };
  for (const auto& sample : driven.samples) {
    recent.add(sample.time, sample.omega_radps, sample.f_mps2);
    if (sample.speed_mps) recent.add_speed(sample.time, *sample.speed_mps, test::kDrivenSpeedSd_mps);
    take();
  }
  recent.settle();
  take();
  return regimes;
}

TEST_P(Stops, OfOneToTenSecondsAreFoundAndRestAndMotionAreNamedRight) {
  Score afterwards;
  Score meanwhile;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    test::StoppingDrive drive;
    drive.seed = seed;
    drive.has_speed = GetParam().has_speed;
    drive.engine_runs = GetParam().engine_runs;
    drive.gyro_density_radps = GetParam().gyro_deg_per_s_sqrt_hz * kRadPerDeg;
    drive.accel_density_mps2 = GetParam().accel_mps2_sqrt_hz;
    const auto driven = test::driven(drive);
    const auto track = static_and_dynamic(driven.levels, {});
    add(
        driven, [&](HostTime time) { return track.at(time); }, afterwards);
    const auto settled = settled_regimes(driven);
    ASSERT_EQ(settled.size(), driven.samples.size());
    add(
        driven, [&](HostTime time) { return std::prev(settled.upper_bound(time))->second; }, meanwhile);
  }
  const auto share = [](int part, int whole) { return 100.0 * part / whole; };
  for (const Score& score : {afterwards, meanwhile}) {
    EXPECT_GE(share(score.found, score.stops), GetParam().goal.stops_percent);
    EXPECT_GE(share(score.rest_right, score.at_rest), GetParam().goal.rest_percent);
    EXPECT_GE(share(score.motion_right, score.in_motion), GetParam().goal.motion_percent);
  }
}

/// What a run has to reach. Without a speed a body that still swings is no rest, and a car that rolls
/// smoothly is no motion: nothing else could tell.
constexpr Goal kBySpeed{95.0, 98.0, 98.0};
constexpr Goal kWithoutSpeed{92.0, 90.0, 96.0};

INSTANTIATE_TEST_SUITE_P(Worlds, Stops,
                         testing::Values(World{"NavigationGrade", true, 2.5e-5, 5e-5, kBySpeed, true},
                                         World{"NavigationGradeNoSpeed", true, 2.5e-5, 5e-5, kWithoutSpeed,
                                               false},
                                         World{"NoEngine", false, 0.002, 5e-4, kBySpeed, true},
                                         World{"NoEngineNoSpeed", false, 0.002, 5e-4, kWithoutSpeed, false},
                                         World{"Mems", true, 0.01, 2e-3, kBySpeed, true},
                                         World{"MemsNoSpeed", true, 0.01, 2e-3, kWithoutSpeed, false},
                                         World{"NoisyMems", true, 0.08, 4e-3, kBySpeed, true},
                                         World{"NoisyMemsNoSpeed", true, 0.08, 4e-3, kWithoutSpeed, false}),
                         [](const auto& world) { return std::string(world.param.name); });

TEST(RecentRegimes, TellOfAHoleTooLongToBelongTogetherAndKeepNothingOlderThanTheirWindow) {
  RecentRegimes recent({});
  EXPECT_FALSE(recent.settled_until()) << "nothing is known yet";
  const Vector3 rest{0.0, 0.0, -9.81};
  for (int k = 0; k < 10'000; ++k) recent.add(at_second(0.01 * k), {}, rest);
  ASSERT_TRUE(recent.settled_until());
  EXPECT_LE(to_seconds(at_second(99.99) - *recent.settled_until()),
            RecentRegimes::kLookAhead_s + RecentRegimes::kStep_s);
  EXPECT_EQ(recent.at(at_second(80.0)), 0U);
  EXPECT_EQ(recent.at(at_second(1.0)), std::nullopt) << "forgotten";
  EXPECT_TRUE(recent.follows(at_second(150.0)));
  EXPECT_TRUE(recent.follows(at_second(60.0)));
  EXPECT_FALSE(recent.follows(at_second(170.0)));
  EXPECT_FALSE(recent.follows(at_second(20.0))) << "a clock that was set back";
  recent.add_speed(at_second(-1e6), 3.0, 0.1);  // of long ago: makes no cells
  recent.settle();
  EXPECT_EQ(recent.at(at_second(99.99)), 0U);
}

}  // namespace
}  // namespace imuscope
