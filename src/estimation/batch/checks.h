#pragma once

/// Where the batch estimate begins, and whether the two records are of two IMUs on one body at all. What is
/// wrong is said in words that name the line of the configuration.

#include <Eigen/Core>

#include "base/result.h"
#include "estimation/batch/imu_record.h"

namespace imuscope::batch {

/// Mounting and clock before the estimate: good to a degree and a few milliseconds.
struct Start {
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();
  double time_offset_s = 0.0;     ///< added to the S-IMU's times
  double rate_correlation = 0.0;  ///< of the turned rates, 0 to 1
};

/// Errors of kind kWork, where the records do not tell: too short together; no clear time offset within
/// +-search_s. Of kind kUsage, where they tell that something is wrong: rates that differ in size (units),
/// are mirrored (axes), are not alike (another body) or are the very same numbers (a copy).
[[nodiscard]] Result<Start> find_start(const ImuRecord& reference, const ImuRecord& study, double search_s);

/// The instants, on the reference's scale, that both records cover.
[[nodiscard]] std::vector<double> common_instants(const ImuRecord& reference, const ImuRecord& study,
                                                  double time_offset_s, double rate_hz);

}  // namespace imuscope::batch
