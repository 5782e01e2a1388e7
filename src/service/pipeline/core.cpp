#include "service/pipeline/core.h"

#include <algorithm>
#include <utility>

#include "base/contracts.h"

namespace imuscope {

namespace {

std::size_t ring_capacity_of(const EstimatorConfig& config, std::size_t device) noexcept {
  if (device == config.reference.device) return sample_ring_capacity(config.reference.rate_hz);
  for (const SImuConfig& study : config.studies) {
    if (study.device == device) return sample_ring_capacity(study.rate_hz);
  }
  return sample_ring_capacity(kCommonRate_hz);  // GNSS and wheels send no faster
}

constexpr Duration duration(double value_s) noexcept {
  return Duration{static_cast<std::int64_t>(value_s * 1e9)};
}

}  // namespace

Core::Core(const EstimatorConfig& config, std::size_t n_devices, CoreSchedule schedule, HistorySink* history)
    : estimator_(config, history),
      reference_(config.reference.device),
      late_samples_(n_devices),
      applied_noises_(std::move(schedule.applied_noises)) {
  for (std::size_t i = 0; i < n_devices; ++i) {
    rings_.push_back(std::make_unique<SampleRing>(ring_capacity_of(config, i)));
    is_study_.push_back(std::any_of(config.studies.begin(), config.studies.end(),
                                    [i](const SImuConfig& study) { return study.device == i; }));
  }
  reaches_.resize(n_devices);
  for (std::size_t i = 0; i < config.studies.size(); ++i)
    noises_.push_back(std::make_unique<LatestValue<NewNoise>>());
  std::sort(schedule.late_samples.begin(), schedule.late_samples.end(),
            [](const LateSample& a, const LateSample& b) { return a.sequence < b.sequence; });
  for (const auto& late : schedule.late_samples) {
    if (late.device < n_devices) late_samples_[late.device].push_back(late);
  }
  std::stable_sort(applied_noises_.begin(), applied_noises_.end(),
                   [](const AppliedNoise& a, const AppliedNoise& b) { return a.tick < b.tick; });
}

bool Core::held_back(const Sample& sample, std::int64_t index) const noexcept {
  const auto& late = late_samples_[sample.device];
  const auto found = std::lower_bound(
      late.begin(), late.end(), sample.sequence,
      [](const LateSample& entry, std::uint64_t sequence) { return entry.sequence < sequence; });
  return found != late.end() && found->sequence == sample.sequence && found->tick > index;
}

bool Core::has_front(std::size_t device, std::int64_t index, HostTime cut) const noexcept {
  const Sample* const oldest = rings_[device]->front();
  return oldest != nullptr && oldest->arrival <= cut && !held_back(*oldest, index);
}

/// By the samples' stamps and the cut alone, so that a replay decides the same.
HostTime Core::common_horizon(std::int64_t index, HostTime cut) const noexcept {
  if (horizon_ != HostTime::max()) {
    const HostTime next = horizon_ + duration(kCatchUpStep_s);
    if (next < cut - duration(kCaughtUp_s)) return next;
  }
  if (!has_front(reference_, index, cut)) return HostTime::max();
  const HostTime oldest = rings_[reference_]->front()->time;
  return oldest < cut - duration(kBehind_s) ? oldest + duration(kCatchUpStep_s) : HostTime::max();
}

HostTime Core::reach_of(std::size_t device, std::int64_t index, HostTime cut) noexcept {
  // The reference runs ahead by as long as an S sample waits for it.
  if (horizon_ != HostTime::max())
    return device == reference_ ? horizon_ + duration(kReferenceWait_s) : horizon_;
  if (device == reference_ || !has_front(device, index, cut)) return HostTime::max();
  const Sample& oldest = *rings_[device]->front();
  if (is_study_[device]) {
    if (oldest.time >= cut - duration(kBehind_s)) return HostTime::max();
    steps_study_ = true;
    return oldest.time + duration(kCatchUpStep_s);
  }
  // A solution has no state to be applied to before the reference has come that far, if it comes at all.
  const bool waits = oldest.kind == SampleKind::kGnss && newest_reference_ > HostTime::min() &&
                     cut - newest_reference_ < duration(kLongestStall_s);
  return waits ? newest_reference_ + duration(kBehind_s) : HostTime::max();
}

void Core::look_for_backlog(std::int64_t index, HostTime cut) noexcept {
  horizon_ = common_horizon(index, cut);
  steps_study_ = false;
  for (std::size_t i = 0; i < reaches_.size(); ++i) {
    reaches_[i].before = reaches_[i].now;
    reaches_[i].now = reach_of(i, index, cut);
  }
}

/// An earlier tick would have consumed it, had it been in its ring.
bool Core::was_late(const Sample& sample) const noexcept {
  const Reach& reach = reaches_[sample.device];
  if (sample.arrival <= reach.last_open_cut) return true;
  return sample.arrival <= previous_cut_ && sample.time <= reach.before;
}

void Core::consume(std::int64_t index, HostTime cut, CoreSink& sink) noexcept {
  for (;;) {
    // Oldest arrival first; equal stamps in configuration order, then in sequence (the ring's own order).
    SampleRing* next = nullptr;
    const Sample* oldest = nullptr;
    for (const auto& ring : rings_) {
      const Sample* sample = ring->front();
      if (sample == nullptr || sample->arrival > cut || held_back(*sample, index) ||
          sample->time > reaches_[sample->device].now)
        continue;
      if (oldest == nullptr || sample->arrival < oldest->arrival) {
        oldest = sample;
        next = ring.get();
      }
    }
    if (next == nullptr) return;
    if (was_late(*oldest)) sink.on_late_sample({oldest->device, oldest->sequence, index});
    newest_arrival_ = std::max(newest_arrival_, oldest->arrival);
    note_first_reference(*oldest);
    estimator_.add(*oldest);
    next->pop();
  }
}

void Core::note_first_reference(const Sample& sample) noexcept {
  if (sample.device != reference_ || sample.kind != SampleKind::kImu) return;
  newest_reference_ = std::max(newest_reference_, sample.time);
  snapshot_.reference = sample.imu;
  if (!snapshot_.has_reference) {
    snapshot_.has_reference = true;
    snapshot_.first_reference_time = sample.time;
  }
}

/// From the first who tells it; a device is believed over the PC's clock.
void Core::note_first_utc() noexcept {
  const TimeScale& scale = estimator_.time_scale();
  const bool is_better = first_utc_from_ == UtcSource::kNone ||
                         (first_utc_from_ == UtcSource::kPcClock && scale.source != UtcSource::kPcClock) ||
                         (first_utc_from_ == UtcSource::kGnss && scale.source == UtcSource::kPulses);
  if (!snapshot_.has_reference || scale.source == UtcSource::kNone || !is_better) return;
  first_utc_from_ = scale.source;
  snapshot_.has_utc = true;
  snapshot_.first_reference_utc = scale.at(snapshot_.first_reference_time).utc;
}

/// Before anything of the tick is computed, so that a replay needs the tick's number alone.
void Core::take_over_noises(std::int64_t index, CoreSink& sink) noexcept {
  const auto apply = [&](const AppliedNoise& applied) {
    estimator_.set_noise(applied.study, applied.model.noise);
    sink.on_noise_applied(applied);
  };
  for (std::size_t i = 0; i < noises_.size(); ++i) {
    if (noises_[i]->take()) apply({i, index, noises_[i]->value()});
  }
  for (; next_applied_ < applied_noises_.size() && applied_noises_[next_applied_].tick <= index;
       ++next_applied_) {
    apply(applied_noises_[next_applied_]);
  }
}

void Core::tick(std::int64_t index, HostTime cut, CoreSink& sink) noexcept {
  IMUSCOPE_EXPECTS(cut > previous_cut_);
  take_over_noises(index, sink);
  look_for_backlog(index, cut);
  // What was heard by the tick before: a tick may fall between the reads of two lines.
  const bool all_is_open = horizon_ == HostTime::max();
  if (all_is_open) listened_until_ = std::max(listened_until_, std::min(cut, newest_arrival_));
  consume(index, cut, sink);
  previous_cut_ = cut;
  for (Reach& reach : reaches_) {
    if (reach.now == HostTime::max()) reach.last_open_cut = cut;
  }
  estimator_.advance(listened_until_);

  note_first_utc();
  for (const auto& event : estimator_.events()) sink.on_event(event);
  snapshot_.ages = data_ages(estimator_.navigation(), snapshot_.has_reference, cut);
  const auto speed = vehicle_speed(estimator_.navigation(), estimator_.odometry(), estimator_.counters());
  for (const auto& epoch : estimator_.epochs()) {
    if (!epoch.calibrating) continue;
    sink.on_epoch(epoch, {snapshot_.first_reference_time, snapshot_.ages,
                          validity_of(estimator_.study(epoch.study), snapshot_.ages), speed});
  }
  if (index % kTicksPerSnapshot != 0) return;
  take_snapshot(index, cut);
  sink.on_snapshot(snapshot_);
}

void Core::take_snapshot(std::int64_t index, HostTime cut) noexcept {
  snapshot_.tick = index;
  snapshot_.cut = cut;
  snapshot_.n_studies = estimator_.study_count();
  snapshot_.time_scale = estimator_.time_scale();
  const NavigationOutput& navigation = estimator_.navigation();
  snapshot_.has_new_navigation =
      navigation.status == NavigationStatus::kNavigating && navigation.time != snapshot_.navigation.time;
  snapshot_.navigation = navigation;
  const OdometryOutput& odometry = estimator_.odometry();
  snapshot_.has_new_odometry = odometry.has_speed && odometry.time != snapshot_.odometry.time;
  snapshot_.odometry = odometry;
  for (std::size_t i = 0; i < snapshot_.n_studies; ++i) {
    const SImuOutput& study = estimator_.study(i);
    snapshot_.has_new_study[i] = has_estimate(study.status) && study.time != snapshot_.studies[i].time;
    snapshot_.studies[i] = study;
  }
  snapshot_.counters = estimator_.counters();
}

}  // namespace imuscope
