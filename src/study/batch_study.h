#pragma once

/// The batch estimate of every S-IMU of a recording (src/estimation/batch), and what of it a study publishes.
/// Non-real-time: allocates, uses one thread per S-IMU; the result does not depend on how many there are.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "estimation/batch/batch_mounting.h"
#include "estimation/calibration/combine.h"
#include "estimation/calibration/estimator.h"
#include "sample/sample.h"
#include "study/smoothing.h"

namespace imuscope {

/// Gathers the samples of all IMUs, in stream order. Of a long recording, the first hour and at least the
/// last one: more tells no more of constants, and costs memory.
class BatchRecords {
 public:
  explicit BatchRecords(const Configuration& configuration);

  void add(const Sample& sample);

  /// The samples of a device from one instant to another, as far as they were kept; seconds since origin().
  [[nodiscard]] batch::ImuRecord part(std::size_t device, double from_s, double to_s) const;
  /// Seconds since origin() of a device's first sample; 0 where it has none.
  [[nodiscard]] double first_s(std::size_t device) const;
  /// From here to its end the recording was kept.
  [[nodiscard]] double kept_to_end_from_s(std::size_t device) const;
  [[nodiscard]] HostTime origin() const { return origin_; }

 private:
  struct Kept {
    batch::ImuRecord first;
    batch::ImuRecord last;  ///< what comes after `first`
    double last_s = 0.0;
  };

  std::vector<double> half_period_s_;  ///< of a device's samples, by which increments are centred
  std::vector<Kept> records_;
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
/// moved, and the samples since count: an hour of them, the first that was kept.
/// @param former  what the filter found
[[nodiscard]] std::vector<BatchOutcome> estimate_mountings(const Configuration& configuration,
                                                           const BatchRecords& records,
                                                           const FormerMountings& former);

/// What combine() takes of a mounting that the batch gave.
[[nodiscard]] MountingEstimate estimate_of(const batch::BatchMounting& mounting);

/// Puts the batch's values and sd in place of the filter's.
void take_over(const batch::BatchMounting& mounting, SImuOutput& study);

/// What the study publishes: the batch's values where it found any. Where it found the data to be wrong,
/// nothing of them is believed.
[[nodiscard]] std::vector<SImuOutput> with_batch(std::vector<SImuOutput> studies,
                                                 const std::vector<BatchOutcome>& outcomes);

/// calibration.json's "batch": what has no place among the filter's quantities.
[[nodiscard]] nlohmann::json batch_json(const batch::BatchMounting& mounting);

/// calibration.json's "filter": what the filter had ended with.
[[nodiscard]] nlohmann::json filter_json(const SImuOutput& study, double clock_shift_s);

/// calibration.json's "observability" of a mounting that the batch gave: goals are what makes it usable, and
/// where more motion would not help, no manoeuvre is advised.
[[nodiscard]] nlohmann::json batch_observability_json(const SImuOutput& study,
                                                      const batch::BatchMounting& mounting);

/// What is odd about the result, in a sentence for a person; empty where nothing stands out.
[[nodiscard]] std::string batch_remark(const std::string& name, const batch::BatchMounting& mounting);

}  // namespace imuscope
