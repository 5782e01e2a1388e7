#include "study/mounted_passes.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "service/pipeline/estimator_setup.h"
#include "service/recording/side_by_side.h"

namespace imuscope {

namespace {

/// Steps of nice below who has to be left the processors: the pass that calibrates, and of these two the one that gathers,
/// as smoothing's way back has work for every processor that is idle. Enough for that, and to have a share where other
/// programs compute, for which SCHED_IDLE would wait.
constexpr int kNicerToSmooth = 5;
constexpr int kNicerToGatherAhead = 10;

/// Work in a thread of its own; done when its result is asked for where no second thread may be used.
template <typename Work>
auto in_spare_time(int nicer, Work work) {
  if (!may_use_threads()) return std::async(std::launch::deferred, std::move(work));
  return std::async(std::launch::async, [nicer, work = std::move(work)] {
    constexpr int kNicest = 19;
    // Linux takes this for the calling thread alone.
    setpriority(PRIO_PROCESS, 0, std::min(getpriority(PRIO_PROCESS, 0) + nicer, kNicest));
    return work();
  });
}

/// The estimator of a pass in which every mounting that was found is known.
EstimatorConfig frozen(EstimatorConfig config, const std::vector<SImuOutput>& settled) {
  for (std::size_t i = 0; i < config.studies.size(); ++i) {
    const auto& known = settled[i];
    if (!has_estimate(known.status)) continue;
    config.studies[i] = with_mounting(
        config.studies[i], {known.C_b_s, known.r_bs_b_m, known.t_d_s, known.gyro_scale, known.accel_scale});
  }
  return config;
}

/// Whether both passes take the same of two estimates.
bool are_alike(const SImuOutput& a, const SImuOutput& b) {
  if (has_estimate(a.status) != has_estimate(b.status)) return false;
  return !has_estimate(a.status) || (a.C_b_s == b.C_b_s && a.r_bs_b_m == b.r_bs_b_m && a.t_d_s == b.t_d_s &&
                                     a.gyro_scale == b.gyro_scale && a.accel_scale == b.accel_scale);
}

bool are_alike(const std::vector<SImuOutput>& a, const std::vector<SImuOutput>& b) {
  return std::ranges::equal(
      a, b, [](const SImuOutput& one, const SImuOutput& other) { return are_alike(one, other); });
}

bool are_none(const FormerMountings& former) {
  return std::ranges::all_of(former, [](const auto& of_study) { return of_study.empty(); });
}

}  // namespace

MountedPasses::MountedPasses(const Drive& drive, StudyMountings mountings, EpochGatherer epochs)
    : drive_(drive),
      mountings_(std::move(mountings)),
      epochs_(std::move(epochs)),
      history_({Smoother::kMemory_bytes, drive_.path}) {}

Result<std::unique_ptr<MountedPasses>> MountedPasses::begin(const Drive& drive, StudyMountings mountings,
                                                            bool is_ahead) {
  auto epochs = EpochGatherer::create(drive.folder, mountings.of_drive.size());
  if (!epochs) return tl::unexpected<Error>(epochs.error());
  std::unique_ptr<MountedPasses> passes(new MountedPasses(drive, std::move(mountings), std::move(*epochs)));
  // The calibration pass and smoothing, which has the longer way of the two, fill two processors.
  const bool waits = is_ahead && may_use_threads() && !may_use_third_thread();
  if (!waits) passes->may_gather();
  passes->smoothed_ = in_spare_time(kNicerToSmooth, [p = passes.get()] { return p->smooth(); });
  passes->gathered_ =
      in_spare_time(is_ahead && !waits ? kNicerToGatherAhead : 0, [p = passes.get()] { return p->gather(); });
  return passes;
}

MountedPasses::~MountedPasses() {
  is_given_up_ = true;
  may_gather();
}

void MountedPasses::may_gather() {
  may_gather_ = true;
  may_gather_.notify_all();
}

bool MountedPasses::are_of(const StudyMountings& mountings) const {
  return are_none(mountings.former) && are_none(mountings_.former) &&
         are_alike(mountings.of_drive, mountings_.of_drive) &&
         are_alike(mountings.settled, mountings_.settled);
}

Result<SmoothedTrack> MountedPasses::smooth() {
  return smooth_drive(
      drive_.configuration, drive_.estimator, drive_.recording, mountings_.of_drive, mountings_.former,
      history_,
      [this](double share) {
        share_ = share;
        if (progress_) progress_(share);
      },
      &is_given_up_);
}

Result<ReplayResult> MountedPasses::gather() {
  may_gather_.wait(false);
  ReplayOptions options;
  options.is_given_up = &is_given_up_;
  return replay(drive_.configuration, frozen(drive_.estimator, mountings_.settled), drive_.recording, epochs_,
                options);
}

Result<MountedPasses::Passed> MountedPasses::result(const Progress& progress) {
  constexpr std::chrono::milliseconds kTold{100};
  may_gather();
  std::future_status status = smoothed_.wait_for(std::chrono::seconds{0});
  if (status == std::future_status::deferred) progress_ = progress;
  for (; status == std::future_status::timeout; status = smoothed_.wait_for(kTold)) {
    if (progress) progress(share_);
  }
  auto track = smoothed_.get();
  if (progress) progress(1.0);
  const auto gathered = gathered_.get();
  if (!track) return tl::unexpected<Error>(track.error());
  if (!gathered) return tl::unexpected<Error>(gathered.error());
  return Passed{std::move(*track), std::move(epochs_), std::move(history_)};
}

}  // namespace imuscope
