#pragma once

/// What `imuscope top` shows, as text. Pure functions of the messages heard; nothing here knows a terminal.

#include <imuscope/calibration_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/virtual_imu_t.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace imuscope::top {

/// The newest messages of a service.
struct Heard {
  std::optional<status_t> status;
  double status_age_s = 0.0;                          ///< since it was heard
  std::map<std::string, calibration_t> calibrations;  ///< by S-IMU
  std::map<std::string, noise_model_t> models;        ///< by S-IMU
  std::optional<odometry_t> odometry;
  std::optional<virtual_imu_t> virtual_imu;
  double virtual_imu_age_s = 0.0;  ///< since it was heard
  std::string note;                ///< of the program itself: an event sent, a text being typed
};

/// A service that publishes once a second and is not heard for this long is told to be silent.
inline constexpr double kSilent_s = 3.0;

/// The whole picture, one string a line, without line ends.
[[nodiscard]] std::vector<std::string> lines_of(const Heard& heard);

/// Counts per octave as one row of bars, each as high as the logarithm of its count.
[[nodiscard]] std::string histogram_bars(const std::vector<std::int64_t>& octaves);

/// The same content for programs; unknown numbers are null.
[[nodiscard]] std::string json_of(const Heard& heard);

}  // namespace imuscope::top
