#include <gtest/gtest.h>

#include <string>

#include "regimes/motion_regimes.h"
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

void add(const test::Driven& driven, const RegimeTrack& track, Score& score) {
  const auto static_index = track.index_of(kStaticName);
  const auto dynamic_index = track.index_of(kDynamicName);
  for (std::size_t k = 0; k < driven.stops.size(); ++k) {
    const auto& stop = driven.stops[k];
    bool found = false;
    for (double t = stop.begin_s; t < stop.end_s; t += 0.05) found |= track.at(at_second(t)) == static_index;
    ++score.stops;
    score.found += found ? 1 : 0;
    const double begin_s = k > 0 ? stop.begin_s + kAway_s : 0.0;
    for (double t = begin_s; t < stop.end_s - kAway_s; t += 0.05) {
      ++score.at_rest;
      score.rest_right += track.at(at_second(t)) == static_index ? 1 : 0;
    }
    if (k + 1 == driven.stops.size()) continue;
    for (double t = stop.end_s + kAway_s; t < driven.stops[k + 1].begin_s - kAway_s; t += 0.05) {
      ++score.in_motion;
      score.motion_right += track.at(at_second(t)) == dynamic_index ? 1 : 0;
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

TEST_P(Stops, OfOneToTenSecondsAreFoundAndRestAndMotionAreNamedRight) {
  Score score;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    test::StoppingDrive drive;
    drive.seed = seed;
    drive.has_speed = GetParam().has_speed;
    drive.engine_runs = GetParam().engine_runs;
    drive.gyro_density_radps = GetParam().gyro_deg_per_s_sqrt_hz * kRadPerDeg;
    drive.accel_density_mps2 = GetParam().accel_mps2_sqrt_hz;
    const auto driven = test::driven(drive);
    add(driven, static_and_dynamic(driven.levels, {}), score);
  }
  const auto share = [](int part, int whole) { return 100.0 * part / whole; };
  EXPECT_GE(share(score.found, score.stops), GetParam().goal.stops_percent);
  EXPECT_GE(share(score.rest_right, score.at_rest), GetParam().goal.rest_percent);
  EXPECT_GE(share(score.motion_right, score.in_motion), GetParam().goal.motion_percent);
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

}  // namespace
}  // namespace imuscope
