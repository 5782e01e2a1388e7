#pragma once

/// LCM messages straight from what the core and the modeller put out, in the units of the wire. Pure
/// functions; any non-real-time thread (they allocate). The publisher adds the sequence.

#include <imuscope/calibration_t.hpp>
#include <imuscope/dynamics_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/ins_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/pc_clock_t.hpp>
#include <imuscope/pose_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <optional>
#include <string>
#include <utility>

#include "service/pipeline/core.h"
#include "service/pipeline/refit.h"
#include "service/run/pc_clock.h"

namespace imuscope {

/// utime of a message; 0 where nobody told UTC.
[[nodiscard]] std::int64_t utime_of(const UtcStamp& stamp);

[[nodiscard]] navigation_t navigation_message(const Snapshot& snapshot);
[[nodiscard]] odometry_t odometry_message(const Snapshot& snapshot);
/// @param utc  of the reading, as the run has it
[[nodiscard]] pc_clock_t pc_clock_message(const PcClockLog::News& news, UtcTime utc);
/// Where the motion has shown nothing of a state, its value is NaN.
/// @param study  index of the S-IMU that is called `name`
[[nodiscard]] calibration_t calibration_message(const Snapshot& snapshot, std::size_t study,
                                                const std::string& name);

/// The tenth of a second whose rows a message holds.
class MessageTenth {
 public:
  MessageTenth() = default;
  /// That of a row, since the run's first R-IMU epoch.
  explicit MessageTenth(double time_s);
  /// Every row of it must have come.
  [[nodiscard]] bool is_old(double time_s) const;
  bool operator==(const MessageTenth&) const = default;

 private:
  std::int64_t number_ = 0;
};

/// Gathers the error rows of one S-IMU into messages: what a message holds depends on the rows alone, so that
/// live run and replay send the same.
class ErrorBatch {
 public:
  static constexpr std::size_t kRowsMax = 500;

  /// @param name  of the S-IMU
  explicit ErrorBatch(std::string name) : name_(std::move(name)) {}
  /// Takes a row. The message of the rows before it, where it does not belong to them any more.
  [[nodiscard]] std::optional<error_t> add(const ErrorRecord& record);
  /// The message of what is there, if anything.
  [[nodiscard]] std::optional<error_t> take();
  /// The same once every row of its tenth of a second must have come.
  [[nodiscard]] std::optional<error_t> take_old(double time_s);

 private:
  std::string name_;
  std::optional<error_t> pending_;
  MessageTenth tenth_;
};

[[nodiscard]] wavelet_variance_t wavelet_variance_message(const Refit& refit);
[[nodiscard]] noise_model_t noise_model_message(const Refit& refit);
[[nodiscard]] dynamics_t dynamics_message(const Refit& refit);

/// The navigation solution for those who listen to the widespread pose_t and ins_t, in their frames: body
/// forward-left-up, local east-north-up from `origin` on.
/// @param origin  the first snapshot with a navigation solution
[[nodiscard]] pose_t pose_message(const Snapshot& snapshot, const Snapshot& origin);
[[nodiscard]] ins_t ins_message(const Snapshot& snapshot, const Snapshot& origin);

}  // namespace imuscope
