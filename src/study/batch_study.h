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
#include "service/recording/replay.h"
#include "study/smoothing.h"

namespace imuscope {

/// A mounting is estimated from an hour: more tells no more of constants, and costs memory and time.
inline constexpr double kBatchLongest_s = 3600.0;

/// Gathers the samples of all IMUs, in stream order. Of a long recording, the first hour and at least the last one.
/// The first hour and the rest may be gathered by a thread each.
class BatchRecords {
 public:
  /// @param longest_s  in place of an hour
  explicit BatchRecords(const Configuration& configuration, double longest_s = kBatchLongest_s);

  /// Keeps a sample that lies in its device's first hour.
  void add_to_first(const Sample& sample);
  /// Whether no sample of a device's first hour is to come.
  [[nodiscard]] bool is_first_whole(std::size_t device) const { return records_[device].is_first_whole; }
  /// Keeps a sample that lies behind its device's first hour. Before it, every one of that device must have been given.
  void add_to_later(const Sample& sample);

  /// The samples of a device from one instant to another, as far as they were kept; seconds since origin().
  [[nodiscard]] batch::ImuRecord part(std::size_t device, double from_s, double to_s) const;
  /// As part(), of the first hour alone, which must be whole; the rest may still be gathered.
  [[nodiscard]] batch::ImuRecord part_of_first(std::size_t device, double from_s, double to_s) const;
  /// Seconds since origin() of a device's first sample; 0 where it has none.
  [[nodiscard]] double first_s(std::size_t device) const;
  /// From here to its end the recording was kept.
  [[nodiscard]] double kept_to_end_from_s(std::size_t device) const;
  /// The time of the reference's first sample.
  [[nodiscard]] HostTime origin() const;

 private:
  /// Samples by the time that they are of.
  struct Record {
    std::vector<HostTime> time;
    std::vector<Eigen::Vector3f> omega_radps;
    std::vector<Eigen::Vector3f> f_mps2;
    void add(HostTime time_of_sample, const ImuData& data);
    void forget_before(HostTime instant);
  };
  /// Where one of the two who gather stands.
  struct Stream {
    std::optional<HostTime> first;
    HostTime last{};
  };
  struct Kept {
    Record first;
    Record later;
    Stream of_first;
    Stream of_later;
    bool is_first_whole = false;
  };
  /// The time that a sample is of, where it is one that counts.
  [[nodiscard]] std::optional<HostTime> taken_at(const Sample& sample, Stream& stream) const;
  void add_part(const Record& all, double from_s, double to_s, batch::ImuRecord& part) const;

  std::size_t reference_;
  Duration longest_;
  std::vector<Duration> half_period_;  ///< of a device's samples, by which increments are centred
  std::vector<Kept> records_;
};

/// What the batch made of one S-IMU.
struct BatchOutcome {
  std::optional<batch::BatchMounting> mounting;
  /// kUsage: data or configuration are wrong, and no other estimate of them is to be trusted.
  Error why_not{};
  bool remounted = false;  ///< it sat differently before; the mounting is that of the end
};

/// The batch estimates of all S-IMUs of a recording. The first hour of all IMUs is read by itself, so that it is estimated
/// beside the pass over the recording. The results do not depend on that. Thread: one.
class BatchEstimates {
 public:
  /// Takes a sample. @return whether more of its device are wanted
  using Take = std::function<bool(const Sample&)>;
  /// Hands on the samples of every IMU in stream order, as long as more of it are wanted.
  using Read = std::function<Result<void>(const Take& take)>;
  /// Takes what the outcomes are going to be, unless the filter finds that an S-IMU was moved.
  using Foreseen = std::function<void(const std::vector<BatchOutcome>&)>;

  /// Begins at once, where more than one thread may be used.
  /// @param configuration  outlives this
  /// @param read           called once, by a thread of the pool
  /// @param foreseen       called by a thread of the pool, once and beside the pass, where the first hour gave a
  ///                       mounting of every S-IMU; may be empty
  /// @param longest_s      in place of an hour
  BatchEstimates(const Configuration& configuration, Read read, Foreseen foreseen = {},
                 double longest_s = kBatchLongest_s);
  ~BatchEstimates();
  BatchEstimates(const BatchEstimates&) = delete;
  BatchEstimates& operator=(const BatchEstimates&) = delete;

  /// A sample of the pass, in stream order: what lies behind the first hour is wanted where an S-IMU was moved.
  void add(const Sample& sample) { records_.add_to_later(sample); }

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
  void estimate_first_hours(const Read& read);
  void estimate_first_hour(std::size_t study);
  [[nodiscard]] BatchOutcome outcome_of(std::size_t study, std::optional<double> moved_s);

  const Configuration& configuration_;
  Foreseen foreseen_;
  double longest_s_;
  BatchRecords records_;
  std::vector<std::size_t> studies_;  ///< devices
  std::vector<FirstHour> first_hours_;
  std::atomic<std::size_t> n_ahead_;      ///< S-IMUs whose first hour is not estimated yet
  std::atomic<bool> is_given_up_{false};  ///< what has not begun need not
  tbb::task_group beside_;
};

/// BatchEstimates' way to the samples of a recording.
[[nodiscard]] BatchEstimates::Read reader_of(const Configuration& configuration, const Recording& recording);

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
