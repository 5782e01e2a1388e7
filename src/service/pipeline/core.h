#pragma once

/// One tick of the core, live and in replay: samples leave the devices' rings in the order of arrival and
/// enter the estimator, and what came of it is handed on. What a tick consumes depends on arrival stamps and
/// on the cut alone, never on when it was computed.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "base/limits.h"
#include "estimation/calibration/estimator.h"
#include "estimation/error_process/error_row.h"
#include "rt/latest_value.h"
#include "rt/spsc_ring.h"
#include "sample/sample.h"
#include "service/pipeline/validity.h"
#include "service/pipeline/vehicle_speed.h"

namespace imuscope {

/// Ticks per second of the core.
inline constexpr double kTickRate_hz = 100.0;
inline constexpr Duration kTickPeriod{10'000'000};
inline constexpr auto kTicksPerSnapshot = static_cast<std::int64_t>(kTickRate_hz / kSnapshotRate_hz);

/// After the newest arrival the core runs on for this many ticks, live and in replay.
inline constexpr std::int64_t kTailTicks = 20;

/// From one device to the core.
using SampleRing = SpscRing<Sample, std::dynamic_extent>;

/// The estimates at one tick.
struct Snapshot {
  std::int64_t tick;
  HostTime cut;
  bool has_reference;             ///< a first R-IMU epoch has been seen
  HostTime first_reference_time;  ///< its time of validity: the origin of time_s in every file
  bool has_utc;
  UtcTime first_reference_utc;
  std::size_t n_studies;
  TimeScale time_scale;  ///< UTC against the host's clock
  DataAges ages;
  /// There is one, of a later instant than that of the snapshot before. What is not new is neither written
  /// nor sent.
  bool has_new_navigation;
  bool has_new_odometry;
  std::array<bool, kMaxSImus> has_new_study;
  NavigationOutput navigation;
  OdometryOutput odometry;
  ImuData reference;  ///< newest sample of the R-IMU as measured; zero before the first
  std::array<SImuOutput, kMaxSImus> studies;
  EstimatorCounters counters;
};
static_assert(std::is_trivially_copyable_v<Snapshot>);

/// What all results of a tick have in common.
struct TickFacts {
  HostTime first_reference_time;  ///< origin of time_s
  DataAges ages;
  Validity validity;  ///< of what is made with the S-IMU's calibration
  std::optional<VehicleSpeed> speed;
};

/// One row of the error process on its way out of the core.
struct ErrorRecord {
  std::size_t study;
  HostTime first_reference_time;  ///< origin of time_s
  ErrorRow row;
  DataAges ages{};
  Validity validity = Validity::kUsable;  ///< of the calibration that it was made with
  std::optional<VehicleSpeed> speed{};
  /// That the row was made with.
  Mounting mounting{};
  double t_d_s = 0.0;
};
static_assert(std::is_trivially_copyable_v<ErrorRecord>);

/// A sample that reached its ring only after the tick to which its arrival belonged, and the tick that took
/// it. A replay takes it at the same tick.
struct LateSample {
  DeviceIndex device;
  std::uint64_t sequence;
  std::int64_t tick;
};

/// A noise model on its way from a refit to the estimator.
struct NewNoise {
  std::int64_t samples;  ///< of the S-IMU's error process that the refit had seen
  SImuNoise noise;
  std::int64_t version = 0;  ///< counts the models given back to this S-IMU's filter, from 1
};
static_assert(std::is_trivially_copyable_v<NewNoise>);

/// A noise model that the estimator took over at the beginning of `tick`. A replay takes it over there, too.
struct AppliedNoise {
  std::size_t study;
  std::int64_t tick;
  NewNoise model;
};
static_assert(std::is_trivially_copyable_v<AppliedNoise>);

/// What broke the rule of the ticks in the run that is replayed, or was decided beside the samples.
struct CoreSchedule {
  std::vector<LateSample> late_samples;      ///< any order
  std::vector<AppliedNoise> applied_noises;  ///< any order
};

/// What comes out of a tick. On the real-time side an implementation pushes into rings; in a replay it works.
class CoreSink {
 public:
  virtual ~CoreSink() = default;
  /// One S sample of a calibrated S-IMU. Unless overridden, its row goes to on_error(), made with the
  /// estimate as it stands.
  virtual void on_epoch(const SImuEpoch& epoch, const TickFacts& facts) noexcept {
    on_error({epoch.study,
              facts.first_reference_time,
              live_error_row(epoch),
              facts.ages,
              facts.validity,
              facts.speed,
              {epoch.C_b_s, epoch.r_bs_b_m},
              epoch.t_d_s});
  }
  virtual void on_error(const ErrorRecord& record) noexcept = 0;
  virtual void on_event(const EstimatorEvent& event) noexcept = 0;
  virtual void on_snapshot(const Snapshot& snapshot) noexcept = 0;
  virtual void on_late_sample(const LateSample& late) noexcept = 0;
  virtual void on_noise_applied(const AppliedNoise& applied) noexcept { (void)applied; }
};

/// Consumer of the sample rings and owner of the estimator. Thread: one, save for the rings' producer side.
/// Allocates: in the constructor alone.
///
/// After a stall of the host (the process was stopped, a thread had no processor, a line recovered) the rings
/// hold samples of many seconds. They are good: their times of validity come from the devices' own counts. A
/// core that finds the reference's oldest sample kBehind_s behind its cut catches up: each tick takes
/// kCatchUpStep_s of time of validity from every ring, and a little more of the reference's, so that S
/// samples meet the reference in the order in which both were measured. Meanwhile nothing is given up as
/// late. Nor is it while no device is heard at all: lateness is counted in time in which the host listened.
///
/// The line of one device may stand still alone. Samples of an S-IMU that come long after they were measured
/// are taken in such steps, too; while the reference is silent, S samples wait in the estimator and GNSS
/// solutions in their ring.
class Core {
 public:
  /// @param schedule  of the run that is replayed, empty otherwise
  Core(const EstimatorConfig& config, std::size_t n_devices, CoreSchedule schedule = {},
       HistorySink* history = nullptr);

  /// Producer side of device `device`'s ring.
  [[nodiscard]] SampleRing& ring(DeviceIndex device) noexcept { return *rings_[device]; }

  /// Hands in the noise model of a refit; the next tick takes over the newest. Thread: one, non-real-time.
  void offer_noise(std::size_t study, const NewNoise& model) noexcept { noises_[study]->write(model); }

  /// What the PC's clock showed (Estimator). Call before the first tick.
  void set_pc_clock(HostTime time, UtcTime utc) noexcept { estimator_.set_pc_clock(time, utc); }

  /// Consumes every sample that had arrived by `cut`, advances the estimator and reports to `sink`.
  /// Ticks increase; a skipped tick is simply not called.
  void tick(std::int64_t index, HostTime cut, CoreSink& sink) noexcept;

  [[nodiscard]] const Estimator& estimator() const noexcept { return estimator_; }
  /// Samples of a stall are being caught up with.
  [[nodiscard]] bool catches_up() const noexcept { return horizon_ != HostTime::max() || steps_study_; }

 private:
  /// How far a tick takes the samples of a device, in time of validity.
  struct Reach {
    HostTime now{HostTime::max()};
    HostTime before{HostTime::max()};         ///< of the tick before
    HostTime last_open_cut{HostTime::min()};  ///< of the last tick that took all there was
  };
  void look_for_backlog(std::int64_t index, HostTime cut) noexcept;
  [[nodiscard]] HostTime common_horizon(std::int64_t index, HostTime cut) const noexcept;
  [[nodiscard]] HostTime reach_of(std::size_t device, std::int64_t index, HostTime cut) noexcept;
  [[nodiscard]] bool has_front(std::size_t device, std::int64_t index, HostTime cut) const noexcept;
  [[nodiscard]] bool was_late(const Sample& sample) const noexcept;
  [[nodiscard]] bool held_back(const Sample& sample, std::int64_t index) const noexcept;
  void consume(std::int64_t index, HostTime cut, CoreSink& sink) noexcept;
  void take_over_noises(std::int64_t index, CoreSink& sink) noexcept;
  void note_first_reference(const Sample& sample) noexcept;
  void note_first_utc() noexcept;
  void take_snapshot(std::int64_t index, HostTime cut) noexcept;

  Estimator estimator_;
  DeviceIndex reference_;
  std::vector<std::unique_ptr<SampleRing>> rings_;
  std::vector<std::vector<LateSample>> late_samples_;  ///< per device, by sequence
  std::vector<AppliedNoise> applied_noises_;           ///< of the replayed run, by tick
  std::size_t next_applied_ = 0;
  std::vector<std::unique_ptr<LatestValue<NewNoise>>> noises_;  ///< per study
  HostTime previous_cut_{HostTime::min()};
  HostTime horizon_{HostTime::max()};  ///< of all devices: what is of a later time of validity waits
  std::vector<Reach> reaches_;         ///< one a device
  std::vector<bool> is_study_;
  bool steps_study_ = false;  ///< an S-IMU is caught up with by itself
  HostTime newest_reference_{HostTime::min()};
  HostTime newest_arrival_{HostTime::min()};  ///< of what was consumed
  HostTime listened_until_{HostTime::min()};  ///< what the estimator counts lateness by
  UtcSource first_utc_from_ = UtcSource::kNone;
  Snapshot snapshot_{};
};

}  // namespace imuscope
