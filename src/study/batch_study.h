#pragma once

/// The batch estimate of every S-IMU of a recording (src/estimation/batch), and what of it a study publishes.
/// Non-real-time: allocates, uses one thread per S-IMU; the result does not depend on how many there are.

#include <tbb/task_group.h>

#include <atomic>
#include <functional>
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

/// A mounting is estimated from an hour: more tells no more of constants, and costs memory and time.
inline constexpr double kBatchLongest_s = 3600.0;

/// Gathers the samples of all IMUs, in stream order. Of a long recording, the first hour and at least the last one.
class BatchRecords {
 public:
  /// @param longest_s  in place of an hour
  explicit BatchRecords(const Configuration& configuration, double longest_s = kBatchLongest_s);

  void add(const Sample& sample);

  /// The samples of a device from one instant to another, as far as they were kept; seconds since origin().
  [[nodiscard]] batch::ImuRecord part(std::size_t device, double from_s, double to_s) const;
  /// Seconds since origin() of a device's first sample; 0 where it has none.
  [[nodiscard]] double first_s(std::size_t device) const;
  /// From here to its end the recording was kept.
  [[nodiscard]] double kept_to_end_from_s(std::size_t device) const;
  /// Whether no sample up to this instant is to come, and all there are lie in the first hour, which stays as it is.
  [[nodiscard]] bool is_whole_until(std::size_t device, double to_s) const;
  /// As part(), of the first hour alone. Where that is whole, it may be asked for while samples are added.
  [[nodiscard]] batch::ImuRecord part_of_first(std::size_t device, double from_s, double to_s) const;
  [[nodiscard]] HostTime origin() const { return origin_; }

 private:
  struct Kept {
    batch::ImuRecord first;
    batch::ImuRecord last;  ///< what comes after `first`
    double last_s = 0.0;
  };

  double longest_s_;
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

/// The batch estimates of all S-IMUs from a pass over their recording. Of a long one that of the first hour begins as
/// soon as it is there, beside the rest of the pass. The results do not depend on that. Thread: one.
class BatchEstimates {
 public:
  /// Takes what the outcomes are going to be, unless the filter finds that an S-IMU was moved.
  using Foreseen = std::function<void(const std::vector<BatchOutcome>&)>;

  /// @param configuration  outlives this
  /// @param foreseen       called by a thread of the pool, once and beside the pass, where the first hour gave a
  ///                       mounting of every S-IMU; may be empty
  /// @param longest_s      in place of an hour
  explicit BatchEstimates(const Configuration& configuration, Foreseen foreseen = {},
                          double longest_s = kBatchLongest_s);
  ~BatchEstimates();
  BatchEstimates(const BatchEstimates&) = delete;
  BatchEstimates& operator=(const BatchEstimates&) = delete;

  /// A sample of the pass, in stream order.
  void add(const Sample& sample);
  /// Whether the first hour of an S-IMU was estimated, or is being estimated, beside the pass.
  [[nodiscard]] bool has_begun(std::size_t study) const { return has_begun_[study]; }

  /// After the pass. One outcome an S-IMU, in the order of the configuration. Where the filter found one to sit
  /// differently, the parts before and after are estimated by themselves: only where they contradict each other was
  /// it moved, and the samples since count: an hour of them, the first that was kept.
  /// @param former  what the filter found
  [[nodiscard]] std::vector<BatchOutcome> outcomes(const FormerMountings& former);

 private:
  class Pair;
  /// Of one S-IMU.
  using FirstHour = std::optional<Result<batch::BatchMounting>>;

  [[nodiscard]] Pair pair_of(std::size_t study) const;
  void estimate_first_hour(std::size_t study);
  [[nodiscard]] BatchOutcome outcome_of(std::size_t study, std::optional<double> moved_s);

  const Configuration& configuration_;
  Foreseen foreseen_;
  double longest_s_;
  BatchRecords records_;
  std::vector<std::size_t> studies_;    ///< devices
  std::vector<FirstHour> first_hours_;  ///< those that began beside the pass
  std::vector<bool> has_begun_;
  std::atomic<std::size_t> n_ahead_;      ///< S-IMUs whose first hour is not estimated yet
  std::atomic<bool> is_given_up_{false};  ///< what has not begun need not
  tbb::task_group beside_;
};

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
