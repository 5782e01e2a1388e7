#pragma once

/// The batch estimate of every S-IMU of a recording (src/batch), and what of it a study publishes. Soft
/// world: allocates, uses a thread an S-IMU; the result does not depend on how many there are.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "batch/batch_mounting.h"
#include "calibration/estimator.h"
#include "configuration/config.h"
#include "sample/sample.h"
#include "study/smoothing.h"

namespace imuscope {

/// Gathers the samples of all IMUs, in stream order.
class BatchRecords {
 public:
  explicit BatchRecords(const Configuration& configuration);

  void add(const Sample& sample);

  /// All samples of a device; seconds since origin().
  [[nodiscard]] const batch::ImuRecord& of(std::size_t device) const { return records_[device]; }
  [[nodiscard]] HostTime origin() const { return origin_; }

 private:
  std::vector<double> half_period_s_;  ///< of a device's samples, by which increments are centred
  std::vector<batch::ImuRecord> records_;
  bool has_origin_ = false;
  HostTime origin_{};
};

/// What the batch made of one S-IMU.
struct BatchOutcome {
  std::optional<batch::BatchMounting> mounting;
  /// kUsage: data or configuration are wrong, and no other estimate of them is to be trusted.
  Error why_not{};
  bool remounted = false;  ///< it sat differently before; the mounting is that of the end
};

/// One outcome an S-IMU, in the order of the configuration. Where the filter found one to sit differently,
/// the parts before and after are estimated by themselves: only where they contradict each other was it
/// moved, and the samples since count. Of a long recording, the first hour.
/// @param former  what the filter found
[[nodiscard]] std::vector<BatchOutcome> estimate_mountings(const Configuration& configuration,
                                                           const BatchRecords& records,
                                                           const FormerMountings& former);

/// Puts the batch's values and sd in the place of the filter's.
void take_over(const batch::BatchMounting& mounting, StudyOutput& study);

/// calibration.json's "batch": what has no place among the filter's quantities.
[[nodiscard]] nlohmann::json batch_json(const batch::BatchMounting& mounting);

/// calibration.json's "filter": what the filter had ended with.
[[nodiscard]] nlohmann::json filter_json(const StudyOutput& study, double clock_shift_s);

/// What limits the result, in a sentence for a person; empty where nothing stands out.
[[nodiscard]] std::string batch_remark(const std::string& name, const batch::BatchMounting& mounting);

}  // namespace imuscope
