#include "firmware_sim/motion/drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "firmware_sim/motion/degrees.h"
#include "firmware_sim/random/random.h"

namespace imusim {
namespace {

constexpr double kPi = std::numbers::pi;

// Time grids: the drive is integrated on the fine one, the splines run through the coarse one.
constexpr double kFineStep_s = 0.005;
constexpr std::size_t kFinePerNode = 10;
// What shakes up to 15 Hz asks for nodes at 100 Hz.
constexpr std::size_t kFinePerNodeOfRoughRoad = 2;

// Stop-and-go cycles, all uniform draws.
constexpr double kTopSpeedLow_mps = 8.0;
constexpr double kTopSpeedHigh_mps = 17.0;
constexpr double kAccelerationLow_mps2 = 1.3;
constexpr double kAccelerationHigh_mps2 = 2.5;
constexpr double kBrakingLow_mps2 = 1.5;
constexpr double kBrakingHigh_mps2 = 3.0;
constexpr double kCruiseLow_s = 20.0;
constexpr double kCruiseHigh_s = 55.0;
constexpr double kStopLow_s = 4.0;
constexpr double kStopHigh_s = 10.0;
// The Gaussian's feet are slower than this, and shake nothing.
constexpr double kFootOfStop_mps = 0.01;
constexpr double kSpeedSmoothing_s = 0.4;  // standard deviation of the Gaussian
constexpr double kSpeedRipple = 0.04;
constexpr double kSpeedRippleScale_s = 1.5;
constexpr double kShortestCycle_s = 6.0;

// Turns: sin^2 pulses of yaw rate.
constexpr double kTurnLow_s = 3.5;
constexpr double kTurnHigh_s = 6.5;
constexpr double kTurnGapLow_s = 2.0;
constexpr double kTurnGapHigh_s = 9.0;
constexpr double kYawRateMax_radps = 0.55;
constexpr double kLateralAccelerationMax_mps2 = 3.2;
constexpr double kTurnShareLow = 0.35;
// Below this speed a turn fades out: a car does not turn where it stands.
constexpr double kTurnFadeSpeed_mps = 1.0;

// Road, by distance, and the body on its springs.
constexpr double kGradeRms_rad = 2.0 * kRadPerDeg;
constexpr double kBankRms_rad = 1.2 * kRadPerDeg;
constexpr double kGradeLow_per_m = 1.0 / 1500.0;
constexpr double kGradeHigh_per_m = 1.0 / 300.0;
constexpr double kBankLow_per_m = 1.0 / 1000.0;
constexpr double kBankHigh_per_m = 1.0 / 200.0;
constexpr double kBodyPitch_rad_per_mps2 = 0.0044;
constexpr double kBodyRoll_rad_per_mps2 = 0.0075;

// Roughness: a band of frequencies, with these standard deviations at the reference speed.
constexpr double kRoughnessLow_hz = 0.3;
constexpr double kRoughnessHigh_hz = 1.5;
constexpr double kRoughnessSpeed_mps = 10.0;
constexpr double kRoughRoll_rad = 0.25 * kRadPerDeg;
constexpr double kRoughPitch_rad = 0.20 * kRadPerDeg;
constexpr double kRoughHeave_mps = 0.045;  // vertical velocity
// Heave is not cut off at the band's edges but falls off beyond them as second-order filtered noise does, up
// to here: that gives the study's 0.38 m/s^2 of vertical force and 4.7 m/s^3 of jerk (what its time offset's
// standard deviation of 22 us asks for), where a band with sharp edges gives 0.28 and 2.2.
constexpr double kHeaveSkirtLow_hz = 0.1;
constexpr double kHeaveSkirtHigh_hz = 3.4;

// A rough road: rates of roll and pitch, and vertical force, are as strong at every frequency; up to where wheels
// hop they have these standard deviations at the reference speed. A radio-controlled car on a field shows 2 deg/s in
// each of the bands 3 to 6, 6 to 10 and 10 to 15 Hz, a passenger car in town a fifth of it.
constexpr double kShakeLow_hz = 1.5;
constexpr double kShakeRate_radps = 3.0 * kRadPerDeg;
constexpr double kShakeForce_mps2 = 0.5;

/// Sd of the integral over time of what has an sd of one up to where wheels hop, and goes to `to_hz`.
double shake_integral_s(double to_hz) {
  if (to_hz <= kShakeLow_hz) return 0.0;
  return std::sqrt((1.0 / kShakeLow_hz - 1.0 / to_hz) / (kWheelHop_hz - kShakeLow_hz)) / (2.0 * kPi);
}

double same_everywhere(double /*frequency_hz*/) { return 1.0; }

/// Power of the integral of what has the same power at every frequency.
double integrated(double frequency_hz) { return 1.0 / (frequency_hz * frequency_hz); }

/// Power of second-order low- and high-pass filtered white noise with the roughness band's corners.
double heave_power(double frequency_hz) {
  const double below = std::pow(kRoughnessLow_hz / frequency_hz, 4);
  const double above = std::pow(frequency_hz / kRoughnessHigh_hz, 4);
  return 1.0 / ((1.0 + below) * (1.0 + above));
}

/// Sum of sinusoids with random frequencies and phases, of unit variance; smooth to any derivative.
class SmoothNoise {
 public:
  /// @param power  density over frequency, up to a factor
  SmoothNoise(Random& random, double low_hz, double high_hz, double (*power)(double) = same_everywhere) {
    // One frequency in each equal part of the band: every seed fills the band evenly.
    const double part_hz = (high_hz - low_hz) / static_cast<double>(kWaves);
    double from_hz = low_hz;
    double sum = 0.0;
    for (Wave& wave : waves_) {
      const double frequency_hz = random.uniform(from_hz, from_hz + part_hz);
      wave.omega = 2.0 * kPi * frequency_hz;
      wave.phase = random.uniform(0.0, 2.0 * kPi);
      wave.amplitude = std::sqrt(2.0 * power(frequency_hz));
      sum += power(frequency_hz);
      from_hz += part_hz;
    }
    for (Wave& wave : waves_) wave.amplitude /= std::sqrt(sum);
  }
  [[nodiscard]] double at(double x) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) sum += wave.amplitude * std::sin(wave.omega * x + wave.phase);
    return sum;
  }

 private:
  static constexpr std::size_t kWaves = 24;
  struct Wave {
    double omega = 0.0;
    double phase = 0.0;
    double amplitude = 0.0;
  };
  std::array<Wave, kWaves> waves_;
};

struct Grid {
  std::size_t fine_points;
  [[nodiscard]] std::size_t index(double t_s) const {
    const auto nearest = static_cast<std::size_t>(std::lround(std::max(t_s, 0.0) / kFineStep_s));
    return std::min(nearest, fine_points - 1);
  }
};

std::size_t fine_per_node(const Scenario& scenario) {
  return scenario.rough_road_to_hz > 0.0 ? kFinePerNodeOfRoughRoad : kFinePerNode;
}

Grid grid_for(double duration_s) {
  // A whole number of nodes, and a few beyond the end, where the vehicle stands.
  const auto nodes = static_cast<std::size_t>(std::ceil(duration_s / (kFineStep_s * kFinePerNode))) + 4;
  return {nodes * kFinePerNode + 1};
}

double final_standstill_s(double duration_s) { return std::min(60.0, duration_s / 15.0); }

/// Trapezoids of speed, one a cycle, before smoothing.
std::vector<double> speed_trapezoids(double duration_s, double standstill_s, const Grid& grid,
                                     Random random) {
  std::vector<double> speed(grid.fine_points, 0.0);
  // The Gaussian reaches to either side; the standstill begins and ends when it has died away.
  const double margin_s = 4.0 * kSpeedSmoothing_s;
  double begin = standstill_s + margin_s;
  const double end = duration_s - final_standstill_s(duration_s) - margin_s;
  while (end - begin > kShortestCycle_s) {
    double top = random.uniform(kTopSpeedLow_mps, kTopSpeedHigh_mps);
    const double acceleration = random.uniform(kAccelerationLow_mps2, kAccelerationHigh_mps2);
    const double braking = random.uniform(kBrakingLow_mps2, kBrakingHigh_mps2);
    double cruise = random.uniform(kCruiseLow_s, kCruiseHigh_s);
    const double stop = random.uniform(kStopLow_s, kStopHigh_s);
    // The last cycle is made to fit: first a shorter cruise, then a lower speed.
    const double ramps_per_mps = 1.0 / acceleration + 1.0 / braking;
    constexpr double kRampShareMax = 0.7;
    top = std::min(top, kRampShareMax * (end - begin) / ramps_per_mps);
    cruise = std::min(cruise, end - begin - top * ramps_per_mps);
    const double length = top * ramps_per_mps + cruise;
    for (std::size_t i = grid.index(begin); i <= grid.index(begin + length); ++i) {
      const double since = static_cast<double>(i) * kFineStep_s - begin;
      speed[i] = std::max(0.0, std::min({top, acceleration * since, braking * (length - since)}));
    }
    begin += length + stop;
  }
  return speed;
}

std::vector<double> gaussian_smoothed(const std::vector<double>& values, double sigma_s) {
  const auto reach = static_cast<std::ptrdiff_t>(std::lround(4.0 * sigma_s / kFineStep_s));
  std::vector<double> weights;
  double sum = 0.0;
  for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
    const double x = static_cast<double>(k) * kFineStep_s / sigma_s;
    weights.push_back(std::exp(-0.5 * x * x));
    sum += weights.back();
  }
  const auto size = static_cast<std::ptrdiff_t>(values.size());
  std::vector<double> smooth(values.size(), 0.0);
  for (std::ptrdiff_t i = 0; i < size; ++i) {
    if (values[static_cast<std::size_t>(i)] == 0.0) continue;
    // Spread each value: most of a standstill costs nothing.
    const double share = values[static_cast<std::size_t>(i)] / sum;
    const std::ptrdiff_t first = std::max<std::ptrdiff_t>(0, i - reach);
    const std::ptrdiff_t last = std::min<std::ptrdiff_t>(size - 1, i + reach);
    for (std::ptrdiff_t j = first; j <= last; ++j)
      smooth[static_cast<std::size_t>(j)] += share * weights[static_cast<std::size_t>(j - i + reach)];
  }
  return smooth;
}

std::vector<double> make_speed(const Scenario& scenario, const Grid& grid) {
  if (scenario.kind == ScenarioKind::kStatic) return std::vector<double>(grid.fine_points, 0.0);
  std::vector<double> speed =
      gaussian_smoothed(speed_trapezoids(scenario.duration_s, initial_standstill_s(scenario), grid,
                                         Random(scenario.seed, "speed")),
                        kSpeedSmoothing_s);
  Random random(scenario.seed, "speed ripple");
  const double corner_hz = 1.0 / (2.0 * kPi * kSpeedRippleScale_s);
  const SmoothNoise ripple(random, 0.5 * corner_hz, 1.5 * corner_hz);
  for (std::size_t i = 0; i < speed.size(); ++i) {
    if (speed[i] > 0.0) speed[i] *= 1.0 + kSpeedRipple * ripple.at(static_cast<double>(i) * kFineStep_s);
  }
  return speed;
}

std::vector<double> make_yaw_rate(const Scenario& scenario, const std::vector<double>& speed,
                                  const Grid& grid) {
  std::vector<double> rate(speed.size(), 0.0);
  if (scenario.kind == ScenarioKind::kStraightRoad) return rate;
  Random random(scenario.seed, "turns");
  double begin = 0.0;
  while (true) {
    begin += random.uniform(kTurnGapLow_s, kTurnGapHigh_s);
    const double length = random.uniform(kTurnLow_s, kTurnHigh_s);
    const double share = random.uniform(kTurnShareLow, 1.0);
    const double sign = random.uniform() < 0.5 ? -1.0 : 1.0;
    if (begin + length > scenario.duration_s) return rate;
    const double speed_there = std::max(speed[grid.index(begin + 0.5 * length)], kTurnFadeSpeed_mps);
    const double amplitude =
        sign * share * std::min(kYawRateMax_radps, kLateralAccelerationMax_mps2 / speed_there);
    for (std::size_t i = grid.index(begin); i <= grid.index(begin + length); ++i) {
      const double phase = (static_cast<double>(i) * kFineStep_s - begin) / length;
      if (phase <= 0.0 || phase >= 1.0 || speed[i] == 0.0) continue;
      const double v2 = speed[i] * speed[i];
      const double fade = v2 / (v2 + kTurnFadeSpeed_mps * kTurnFadeSpeed_mps);
      const double sine = std::sin(kPi * phase);
      rate[i] = amplitude * sine * sine * fade;
    }
    begin += length;
  }
}

std::vector<MovingSpan> moving_spans(const std::vector<double>& speed) {
  std::vector<MovingSpan> spans;
  bool moving = false;
  for (std::size_t i = 0; i < speed.size(); ++i) {
    const double t_s = static_cast<double>(i) * kFineStep_s;
    if (speed[i] > kFootOfStop_mps && !moving) spans.push_back({t_s, t_s});
    moving = speed[i] > kFootOfStop_mps;
    if (moving) spans.back().end_s = t_s;
  }
  return spans;
}

}  // namespace

double initial_standstill_s(const Scenario& scenario) {
  constexpr double kLong_s = 180.0;
  return scenario.initial_standstill_s.value_or(scenario.duration_s < kLong_s ? 10.0 : 60.0);
}

DriveNodes make_drive(const Scenario& scenario) {
  const Grid grid = grid_for(scenario.duration_s);
  const std::vector<double> speed = make_speed(scenario, grid);
  const std::vector<double> yaw_rate = make_yaw_rate(scenario, speed, grid);

  Random road(scenario.seed, "road");
  const SmoothNoise grade_by_m(road, kGradeLow_per_m, kGradeHigh_per_m);
  const SmoothNoise bank_by_m(road, kBankLow_per_m, kBankHigh_per_m);
  Random rough(scenario.seed, "roughness");
  const SmoothNoise rough_roll(rough, kRoughnessLow_hz, kRoughnessHigh_hz);
  const SmoothNoise rough_pitch(rough, kRoughnessLow_hz, kRoughnessHigh_hz);
  const SmoothNoise rough_heave(rough, kHeaveSkirtLow_hz, kHeaveSkirtHigh_hz, heave_power);
  Random shake(scenario.seed, "rough road");
  const double shake_to_hz = std::max(kShakeLow_hz, scenario.rough_road_to_hz);
  const SmoothNoise shake_roll(shake, kShakeLow_hz, shake_to_hz, integrated);
  const SmoothNoise shake_pitch(shake, kShakeLow_hz, shake_to_hz, integrated);
  const SmoothNoise shake_heave(shake, kShakeLow_hz, shake_to_hz, integrated);
  const double shake_s = shake_integral_s(scenario.rough_road_to_hz);
  const auto shaken = [&](const SmoothNoise& noise, double t_s) {
    return shake_s > 0.0 ? shake_s * noise.at(t_s) : 0.0;
  };
  const std::size_t per_node = fine_per_node(scenario);

  DriveNodes nodes;
  nodes.step_s = kFineStep_s * static_cast<double>(per_node);
  nodes.moving = moving_spans(speed);
  double distance = 0.0;
  double heading = Random(scenario.seed, "start heading").uniform(0.0, 2.0 * kPi);
  double latitude_offset = 0.0;
  double longitude_offset = 0.0;
  double height = scenario.start.height_m;
  for (std::size_t i = 0; i < grid.fine_points; ++i) {
    const double grade = kGradeRms_rad * grade_by_m.at(distance);
    if (i % per_node == 0) {
      const double t_s = static_cast<double>(i) * kFineStep_s;
      const bool inside = i > 0 && i + 1 < grid.fine_points;
      const double acceleration = inside ? (speed[i + 1] - speed[i - 1]) / (2.0 * kFineStep_s) : 0.0;
      const double roughness = speed[i] / kRoughnessSpeed_mps;
      nodes.latitude_offset_rad.push_back(latitude_offset);
      nodes.longitude_offset_rad.push_back(longitude_offset);
      nodes.height_m.push_back(height);
      // The body leans out of a turn and squats when it accelerates.
      nodes.roll_rad.push_back(kBankRms_rad * bank_by_m.at(distance) -
                               kBodyRoll_rad_per_mps2 * speed[i] * yaw_rate[i] +
                               roughness * kRoughRoll_rad * rough_roll.at(t_s) +
                               roughness * kShakeRate_radps * shaken(shake_roll, t_s));
      nodes.pitch_rad.push_back(grade + kBodyPitch_rad_per_mps2 * acceleration +
                                roughness * kRoughPitch_rad * rough_pitch.at(t_s) +
                                roughness * kShakeRate_radps * shaken(shake_pitch, t_s));
      nodes.heading_rad.push_back(heading);
    }
    if (i + 1 == grid.fine_points) break;
    // Mid-point rule: what the vehicle does between two fine points, along its heading and the grade.
    const double step_m = 0.5 * (speed[i] + speed[i + 1]) * kFineStep_s;
    const double turn = 0.5 * (yaw_rate[i] + yaw_rate[i + 1]) * kFineStep_s;
    const double middle = heading + 0.5 * turn;
    const double latitude = scenario.start.latitude_rad + latitude_offset;
    const EarthRadii radii = earth_radii(latitude);
    latitude_offset += step_m * std::cos(grade) * std::cos(middle) / (radii.meridian_m + height);
    longitude_offset +=
        step_m * std::cos(grade) * std::sin(middle) / ((radii.transverse_m + height) * std::cos(latitude));
    const double middle_s = (static_cast<double>(i) + 0.5) * kFineStep_s;
    const double roughness = speed[i] / kRoughnessSpeed_mps;
    const double heave_mps = kRoughHeave_mps * roughness * rough_heave.at(middle_s) +
                             kShakeForce_mps2 * roughness * shaken(shake_heave, middle_s);
    height += step_m * std::sin(grade) + heave_mps * kFineStep_s;
    heading += turn;
    distance += step_m;
  }
  return nodes;
}

}  // namespace imusim
