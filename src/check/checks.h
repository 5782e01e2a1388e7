#pragma once

/// The checks, each of one kind of mistake. They add to `findings`; those that find a unit or a time that is
/// wrong put it right in the drive, so that what follows looks at what was meant.

#include <string>
#include <vector>

#include "check/finding.h"
#include "check/tracks.h"

namespace imuscope::check {

/// The name of the check of a device all of whose samples have one time: nothing else can be seen of it.
inline constexpr const char* kStandingStamps = "standing times";

/// Whether two IMUs were given each other's file.
/// @return whether they were
bool check_files(const Drive& drive, std::vector<Finding>& findings);

/// Whether devices that share a clock with the reference were there when it was.
/// @return whether this one was
bool check_overlap(Drive& drive, std::size_t device, std::vector<Finding>& findings);

/// Rate against the configuration and the stamps, gaps, repeated samples, lost counters.
void check_stamps(Drive& drive, std::size_t device, std::vector<Finding>& findings);

/// Ends of the range, steps coarser than the noise, axes that do not move.
void check_signals(const Drive& drive, std::size_t device, std::vector<Finding>& findings);

/// The size of gravity. Corrects a unit, and puts exchanged triads in their place.
void check_gravity_norm(Drive& drive, std::size_t device, std::vector<Finding>& findings);

/// Jumps, positions that stand while the vehicle moves, claimed sd.
void check_positions(const Drive& drive, std::size_t device, std::vector<Finding>& findings);

/// What the reference's axes are seen to be.
struct ReferenceAxes {
  Eigen::Vector3d down = Eigen::Vector3d::UnitZ();       ///< of its forces, in b as configured
  bool has_course = false;                               ///< the rest is known
  Eigen::Vector3d gyro_down = Eigen::Vector3d::UnitZ();  ///< the axis that turns with the course
  bool has_forward = false;
  Eigen::Vector3d ahead = Eigen::Vector3d::UnitX();  ///< level, from which forward_rad counts ...
  Eigen::Vector3d right = Eigen::Vector3d::UnitY();  ///< ... towards this one
  double forward_rad = 0.0;                          ///< direction of travel
  bool mirrored = false;                             ///< its forces turn left where the vehicle turns right
};

/// A gyro that does not return to zero, where its unit is known to be right.
void check_gyro_offset(const Drive& drive, std::size_t device, std::vector<Finding>& findings);

/// Of rates or forces that are what a sample adds, and what mends them.
inline constexpr const char* kIncrements = "its rates are increments of angle from sample to sample";
[[nodiscard]] std::string divide_by_the_time_of_a_sample(const DeviceConfig& config);

/// Positions against the reference's motion: whose time they are of, whether they are of this drive, units of
/// the positions and of the reference's rates, a mirrored map. Corrects time, rates and map. @param gnss  device
[[nodiscard]] ReferenceAxes check_motion(Drive& drive, std::size_t gnss, std::vector<Finding>& findings);

/// Directions of the reference's axes without a receiver: which one is down.
[[nodiscard]] ReferenceAxes reference_down(const Drive& drive);

/// What the comparison of one S-IMU with the reference tells of the axes of either.
struct PairAxes {
  bool compared = false;
  bool fits = true;  ///< one rotation takes rates and forces of the reference to those of the S-IMU
  /// Where it does not, of the S-IMU's axes: what turns its rates, or its forces, into those that do fit.
  Eigen::Matrix3d study_gyro = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d study_accel = Eigen::Matrix3d::Identity();
  /// The same, if it is the reference that is wrong.
  Eigen::Matrix3d reference_gyro = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d reference_accel = Eigen::Matrix3d::Identity();
  double healthy_cost = 1.0;  ///< residual of the best rotation, in units of that of the best fit of all
  double study_cost = 1.0;
  double reference_cost = 1.0;
};

/// One S-IMU against the reference: units, time, another body, a copy. Corrects units.
[[nodiscard]] PairAxes check_pair(Drive& drive, std::size_t study, std::vector<Finding>& findings);

/// What is wrong with whose axes.
void check_axes(const Drive& drive, const ReferenceAxes& reference,
                const std::vector<std::pair<std::size_t, PairAxes>>& pairs, std::vector<Finding>& findings);

/// Whether there is rest, and whether there are turns both ways.
void check_drive(const Drive& drive, const ReferenceAxes& reference, std::vector<Finding>& findings);

}  // namespace imuscope::check
