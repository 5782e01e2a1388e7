#pragma once

/// A car's drive as nodes for splines: standstill, stop-and-go with turns on an uneven, sloping road,
/// standstill. All numbers are those of the study that the project's goals come from, stated in drive.cpp.

#include <cstdint>
#include <optional>
#include <vector>

#include "firmware_sim/motion/earth.h"

namespace imusim {

/// Where wheels hop.
inline constexpr double kWheelHop_hz = 15.0;

/// What the vehicle does.
enum class ScenarioKind {
  kDrive,         ///< standstill, stop-and-go drive, standstill
  kStatic,        ///< standstill throughout
  kStraightRoad,  ///< the drive without its turns
};

struct Scenario {
  ScenarioKind kind = ScenarioKind::kDrive;
  double duration_s = 900.0;  ///< above 1 s
  /// Standstill at the beginning of a drive; absent: 60 s, or 10 s where the whole lasts less than 180 s.
  std::optional<double> initial_standstill_s;
  std::uint64_t seed = 1;
  bool engine_runs = false;  ///< the vehicle vibrates as a rigid body, besides its drive
  /// Up to here the body rolls, pitches and heaves on a rough road, as a small car's does; 0: no such road.
  double rough_road_to_hz = 0.0;
  GeodeticPosition start = {46.52 * 3.14159265358979323846 / 180.0, 6.57 * 3.14159265358979323846 / 180.0,
                            420.0};
};

/// Standstill at the beginning of a drive.
double initial_standstill_s(const Scenario& scenario);

/// Times between which the vehicle moves without standing still.
struct MovingSpan {
  double begin_s;
  double end_s;
};

/// Equally spaced in time, the first at time 0.
struct DriveNodes {
  double step_s = 0.0;
  // Angles from the start; the motion turns them into latitude and longitude.
  std::vector<double> latitude_offset_rad;
  std::vector<double> longitude_offset_rad;
  std::vector<double> height_m;
  std::vector<double> roll_rad;
  std::vector<double> pitch_rad;
  std::vector<double> heading_rad;  ///< continuous, not wrapped
  std::vector<MovingSpan> moving;   ///< every span between two stops
};

DriveNodes make_drive(const Scenario& scenario);

}  // namespace imusim
