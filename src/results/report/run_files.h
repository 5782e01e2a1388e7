#pragma once

/// What a run folder holds, read once, in a size that does not depend on the length of the run.

#include <array>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "results/report/binned_signals.h"
#include "results/report/scatter.h"

namespace imuscope::report {

/// Signals of RunFiles::navigation.
enum NavigationSignal : std::size_t {
  kNorth_m,  ///< metres from the first position, in its tangent plane
  kEast_m,
  kHeight_m,
  kSpeed_mps,
  kSdNorth_m,
  kSdEast_m,
  kSdDown_m,
  kNavigationSignals
};

/// Signals of RunFiles::odometry.
enum OdometrySignal : std::size_t { kWheelSpeed_mps, kScale_percent, kSdScale_percent, kOdometrySignals };

/// Signals of SImuFiles::calibration; the sd of signal i is signal i + kSdOffset.
enum CalibrationSignal : std::size_t { kPsi_deg = 0, kLeverArm_m = 3, kTimeOffset_ms = 6, kSdOffset = 7 };
inline constexpr std::size_t kCalibrationSignals = 14;

/// Signals of SImuFiles::errors: three of the gyroscope in deg/s, three of the accelerometer in m/s².
inline constexpr std::size_t kErrorSignals = 6;
/// Axes of one sensor: the first three signals are the gyroscope's.
inline constexpr std::size_t kTriad = 3;

/// Time from begin_s to end_s.
struct Stretch {
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// The files of one S-IMU.
struct SImuFiles {
  std::string name;
  nlohmann::json calibration;  ///< its entry in calibration.json
  nlohmann::json truth;        ///< its entry in truth.json; null where there is none
  std::optional<BinnedSignals> calibration_series;
  std::optional<BinnedSignals> errors;
  std::optional<Scatter> scatter;
  std::uint64_t n_errors = 0;               ///< rows of errors_NAME.csv
  std::vector<Stretch> static_stretches;    ///< regime "static" of errors_NAME.csv, the longest ones
  std::array<double, kErrorSignals> rms{};  ///< over the whole record; NaN where there is no value
};

struct RunFiles {
  std::filesystem::path folder;
  nlohmann::json run;          ///< run.json; null where absent
  nlohmann::json models;       ///< array of fits; null where absent
  nlohmann::json regressions;  ///< array; null where absent
  nlohmann::json regression_remarks;
  /// regimes.json, comparison.json, dependence.json, vibration.json, evaluation.json; null where absent.
  nlohmann::json regimes;
  nlohmann::json comparison;
  nlohmann::json dependence;
  nlohmann::json vibration;
  nlohmann::json evaluation;
  bool has_truth = false;
  std::optional<BinnedSignals> navigation;
  std::optional<BinnedSignals> odometry;  ///< of a vehicle whose wheel speeds were recorded
  double wheels_stood_s = 0.0;            ///< as the wheels showed it
  double zero_velocity_s = 0.0;           ///< rest that the filter used
  std::array<double, 2> origin_deg{};     ///< latitude and longitude of the first position
  double distance_m = 0.0;                ///< driven, from the speed
  std::vector<SImuFiles> studies;         ///< in the order of calibration.json
  std::vector<std::string> absent;        ///< names of files that a run may have and this one has not
};

/// Of all S-IMUs.
std::vector<std::string> names_of(const RunFiles& run);
/// Of run.json's `key` ("warnings", "notes"); what several S-IMUs share is one sentence.
std::vector<std::string> sentences_of(const RunFiles& run, const char* key);

/// Errors as write_report().
Result<RunFiles> read_run_files(const std::filesystem::path& folder);

}  // namespace imuscope::report
