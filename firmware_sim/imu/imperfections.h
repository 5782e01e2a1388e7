#pragma once

/// What a data sheet allows a sensor beyond bias, scale and noise, drawn from a seed. A program under test is
/// not told which of it was drawn: claims of honesty are made in the harsh world, the ideal one shows how far
/// an estimator can get.

#include <cstdint>
#include <limits>

#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/random/random.h"

namespace imusim {

/// Which errors there are at all.
enum class WorldKind : std::uint8_t {
  kIdeal,  ///< rigid, orthogonal, instantaneous sensors: bias, scale and noise alone
  kHarsh,  ///< all that is drawn here besides, an engine and a rough road that shake the vehicle, and a
           ///< reference that has scale, misalignment and a low-pass of its own
};

/// Standard deviations of what is drawn, and what all units of a class share.
struct Imperfections {
  /// Departure of each pair of axes of a triad from a right angle, rad: each axis leans by half of it towards
  /// the other.
  double non_orthogonality_sd_rad = 0.0;
  double triads_apart_sd_rad = 0.0;       ///< accelerometer triad against gyro triad, about each axis
  double accel_place_sd_m = 0.0;          ///< each accelerometer, in each axis
  double g_sensitivity_sd_s_per_m = 0.0;  ///< each element, rad/s per m/s^2
  double scale_sd = 0.0;                  ///< on top of the scale that the class has already
  double delay_apart_sd_s = 0.0;          ///< accelerometers later than gyros
  double low_pass_hz = std::numeric_limits<double>::infinity();  ///< of both triads
  double low_pass_sd = 0.0;     ///< of each triad's own corner, as a share of it
  double stated_delay_s = 0.0;  ///< of both triads, taken off the time stamps by the maker
  double own_vibration = 0.0;   ///< what its mount adds, as a share of the vehicle's vibration
};

/// An MTx class sensor: 0.1 deg, 2 cm, 0.05 deg/s/g, 1 ms, 40 Hz with an sd of a tenth, half of the vehicle's vibration.
Imperfections study_imperfections(WorldKind world);
/// The R-IMU: scale, misalignment and bandwidth as makers of its class of gyros state them, time stamps from which
/// the delay of such a low-pass is taken off, a quarter of the vehicle's vibration.
Imperfections reference_imperfections(WorldKind world, const ReferenceClass& of);

/// Adds what is drawn to a sensor's errors. The gyro triad's departure from orthogonality is symmetric: its
/// axes lean about the nominal ones (for the frame that its mounting is told in, see triad_frame()); the
/// accelerometers' places are centred, so that r_bs_b is their mean. The same numbers are drawn in every
/// case: an imperfection that is zero changes no other.
void draw_imperfections(const Imperfections& imperfections, Random& random, ImuErrors& errors);

}  // namespace imusim
