#pragma once

/// What may be said of the calibration of one S-IMU. Three sentences, each with its numbers, for the filter,
/// the files, the messages, the report and the combination of drives alike:
///
/// - it has an estimate: the filter runs, and every value comes with an sd that means something;
/// - it meets the goal: boresight and lever arm are known as well as an error process of this sensor needs
///   them, and no better than its axes are straight (goal_of());
/// - it is usable: what is left uncertain disturbs an error process less than the sensor's own noise does.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/units.h"

namespace imuscope {

/// How far the calibration of one S-IMU has come.
enum class CalibrationStatus : std::uint8_t {
  kWaiting,     ///< no sample yet, or none since a long gap
  kCoarse,      ///< gathering motion for the coarse time offset and mounting
  kConverging,  ///< has an estimate, which does not meet the goal yet
  kCalibrated,  ///< meets the goal; of the estimate of a whole drive, which tells all that there is: usable
};

/// As calibration.json has it, also when the drive is over: then nothing converges any more.
[[nodiscard]] constexpr std::string_view key_of(CalibrationStatus status) noexcept {
  constexpr std::array<std::string_view, 4> kKeys{"waiting", "coarse", "estimated", "calibrated"};
  return kKeys[static_cast<std::size_t>(status)];
}

/// As STATUS and people have it.
[[nodiscard]] constexpr std::string_view words_of(CalibrationStatus status) noexcept {
  constexpr std::array<std::string_view, 4> kWords{"waiting for samples", "looking for its mounting",
                                                   "converging", "calibrated"};
  return kWords[static_cast<std::size_t>(status)];
}

[[nodiscard]] constexpr bool has_estimate(CalibrationStatus status) noexcept {
  return status >= CalibrationStatus::kConverging;
}
/// The same of a status that was read, by key or words; earlier files had the words.
[[nodiscard]] constexpr bool has_estimate(std::string_view status) noexcept {
  return status == key_of(CalibrationStatus::kConverging) ||
         status == words_of(CalibrationStatus::kConverging) ||
         status == key_of(CalibrationStatus::kCalibrated);
}

/// Sd that each axis of the mounting is to have, and the time offset, which has a goal of its own.
struct MountingGoal {
  double boresight_sd_rad = 0.0;
  double lever_arm_sd_m = 0.0;
  double time_offset_sd_s = 0.0;
  friend bool operator==(const MountingGoal&, const MountingGoal&) = default;
};
/// No sensor is asked for more.
inline constexpr MountingGoal kFinestGoal{0.01 * kRadPerDeg, 1e-3, 1e-4};
/// What is still usable. With an automotive MEMS unit (white noise of 0.5 deg/s and 0.02 m/s^2 per sample at
/// 100 Hz) in a roundabout (0.5 rad/s, 1 rad/s^2), it leaves 0.05 deg/s and 0.01 m/s^2.
inline constexpr MountingGoal kUsableGoal{0.1 * kRadPerDeg, 1e-2, 1e-3};
inline constexpr double kUsableBoresightSd_rad = kUsableGoal.boresight_sd_rad;
inline constexpr double kUsableLeverArmSd_m = kUsableGoal.lever_arm_sd_m;
inline constexpr double kUsableTimeOffsetSd_s = kUsableGoal.time_offset_sd_s;

/// What a sensor's class says of how well its mounting needs to be known, and how well it can be.
struct SensorQuality {
  double gyro_white_radps_per_sqrt_hz = 0.0;
  double accel_white_mps2_per_sqrt_hz = 0.0;
  double axes_sd_rad = 0.0;  ///< lean of each axis; 0 where axes are taken to be straight
  double places_sd_m = 0.0;  ///< of the accelerometers about their middle; 0 where they are at one place
};

/// A manoeuvre takes so long, and has so much rate, angular acceleration and acceleration of a metre's lever.
inline constexpr double kManoeuvre_s = 4.0;
inline constexpr double kManoeuvreRate_radps = 0.1;
inline constexpr double kManoeuvreSlope_radps2 = 0.1;
inline constexpr double kManoeuvreLever_per_s2 = 0.2;
/// What the mounting leaves in an error process may be this share of its white noise in a manoeuvre's mean:
/// a sixteenth of the power.
inline constexpr double kNeededShare = 0.25;

/// The goal for a sensor: what its error process needs, at least what its axes and places allow, between the
/// finest and what is usable.
[[nodiscard]] constexpr MountingGoal goal_of(const SensorQuality& sensor) noexcept {
  constexpr double kRootManoeuvre = 2.0;
  static_assert(kRootManoeuvre * kRootManoeuvre == kManoeuvre_s);
  const double rate_radps = kNeededShare * sensor.gyro_white_radps_per_sqrt_hz / kRootManoeuvre;
  const double force_mps2 = kNeededShare * sensor.accel_white_mps2_per_sqrt_hz / kRootManoeuvre;
  const auto between = [](double value, double finest, double usable) {
    return value < finest ? finest : (value > usable ? usable : value);
  };
  const double boresight = rate_radps / kManoeuvreRate_radps;
  const double lever_arm = force_mps2 / kManoeuvreLever_per_s2;
  return {between(boresight > sensor.axes_sd_rad ? boresight : sensor.axes_sd_rad,
                  kFinestGoal.boresight_sd_rad, kUsableGoal.boresight_sd_rad),
          between(lever_arm > sensor.places_sd_m ? lever_arm : sensor.places_sd_m, kFinestGoal.lever_arm_sd_m,
                  kUsableGoal.lever_arm_sd_m),
          between(rate_radps / kManoeuvreSlope_radps2, kFinestGoal.time_offset_sd_s,
                  kUsableGoal.time_offset_sd_s)};
}

/// Per axis; an sd that is NaN meets nothing.
[[nodiscard]] constexpr bool meets_goal(const std::array<double, 3>& boresight_sd_rad,
                                        const std::array<double, 3>& lever_arm_sd_m,
                                        const MountingGoal& goal) noexcept {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(boresight_sd_rad[i] <= goal.boresight_sd_rad) || !(lever_arm_sd_m[i] <= goal.lever_arm_sd_m))
      return false;
  }
  return true;
}

/// Of the largest axis of each.
[[nodiscard]] constexpr bool is_usable(double boresight_sd_rad, double lever_arm_sd_m,
                                       double time_offset_sd_s) noexcept {
  return boresight_sd_rad <= kUsableBoresightSd_rad && lever_arm_sd_m <= kUsableLeverArmSd_m &&
         time_offset_sd_s <= kUsableTimeOffsetSd_s;
}

/// What a person may do with a mounting, on the one scale of console and report.
enum class Usability : std::uint8_t {
  kUsable,
  kWithLimits,  ///< some of its numbers are less certain than is wanted
  kNotUsable,   ///< there is none, or a protractor tells as much
};

/// A protractor and a spirit level are good to a degree.
inline constexpr double kProtractorSd_rad = 1.0 * kRadPerDeg;

/// Of the largest axis of each; an sd that is NaN is not known.
[[nodiscard]] constexpr Usability usability_of(double boresight_sd_rad, double lever_arm_sd_m,
                                               double time_offset_sd_s) noexcept {
  if (is_usable(boresight_sd_rad, lever_arm_sd_m, time_offset_sd_s)) return Usability::kUsable;
  return boresight_sd_rad <= kProtractorSd_rad ? Usability::kWithLimits : Usability::kNotUsable;
}

[[nodiscard]] constexpr std::string_view words_of(Usability usability) noexcept {
  constexpr std::array<std::string_view, 3> kWords{"usable", "usable with limits", "not usable"};
  return kWords[static_cast<std::size_t>(usability)];
}

}  // namespace imuscope
