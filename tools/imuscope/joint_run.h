#pragma once

/// The error processes of all S-IMUs of a run on one grid of time and in one frame.

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope::cli {

inline constexpr std::size_t kErrorAxes = 6;

/// Errors of S-IMUs beside each other.
struct JointRun {
  std::vector<std::string> names;  ///< of the S-IMUs
  double rate_hz = 0.0;
  /// By axis, by S-IMU: rad/s and m/s^2 in the reference's frame b, the rows of the errors' own axes turned
  /// by the mounting, as what the reference does wrong stands in all of them there. NaN: no sample, or
  /// another regime.
  std::array<std::vector<std::vector<double>>, kErrorAxes> values;
};

/// Samples of different S-IMUs lie up to half a period apart; each is taken for the grid's nearest instant.
/// What is common and faster than that shows less than it is: at scales of a few samples "common" is a lower
/// bound.
/// @param names   those to take; empty: all
/// @param regime  "all", or rows of one regime
/// Errors: no run folder, an S-IMU that it does not hold, no mounting of one (kUsage); files that cannot be
/// read, S-IMUs of different rates, no row in the regime (kWork).
Result<JointRun> read_joint_run(const std::filesystem::path& folder, const std::vector<std::string>& names,
                                const std::string& regime);

}  // namespace imuscope::cli
