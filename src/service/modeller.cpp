#include "service/modeller.h"

#include <chrono>
#include <cmath>
#include <utility>

#include "noise/fit.h"
#include "noise/replicates.h"
#include "rt/host_clock.h"
#include "service/models_file.h"

namespace imuscope {

namespace {

constexpr auto kIdleSleep = std::chrono::milliseconds(200);
/// A busy PC may leave an idle thread nothing for many minutes, and rows that wait are memory: behind by this
/// much, half a minute of three S-IMUs at 100 Hz, the thread runs as any other until it has caught up.
constexpr std::uint64_t kBlocksBehind = 128;

}  // namespace

void NewestModels::take(const Refit& refit) {
  nlohmann::json& models = models_[refit.study] = nlohmann::json::array();
  for (const AxisRefit& axis : refit.axes) {
    if (axis.fit) models.push_back(model_json(*axis.fit, refit.name, axis.axis, regime_name(axis.regime)));
  }
}

Result<void> NewestModels::write(const OutputFolder& folder) const {
  if (models_.empty()) return {};
  nlohmann::json all = nlohmann::json::array();
  for (const auto& [study, models] : models_) all.insert(all.end(), models.begin(), models.end());
  return write_models(folder, all);
}

ModelBook::ModelBook(const Configuration& configuration, noise::ModelSpec spec) : spec_(std::move(spec)) {
  for (const auto index : configuration.study_indices()) {
    const auto& device = configuration.devices[index];
    Study study;
    study.name = device.name;
    study.rate_hz = device.rate_hz;
    studies_.push_back(std::move(study));
  }
  set_refit_interval(configuration.noise.refit_interval_s);
}

void ModelBook::set_refit_interval(double interval_s) {
  for (auto& study : studies_) {
    study.samples_per_refit = static_cast<std::size_t>(std::llround(interval_s * study.rate_hz));
  }
}

void ModelBook::set_options(noise::ModelSpec spec, double refit_interval_s) {
  if (!(spec == spec_)) {
    for (auto& study : studies_) {
      for (auto& axis : study.tracks) {
        for (auto& track : axis) track.fit.reset();  // another model cannot start from this one
      }
    }
  }
  spec_ = std::move(spec);
  set_refit_interval(refit_interval_s);
}

void ModelBook::push(Study& study, const ErrorRow& row) {
  const bool joined = study.started && row.counter > study.next_counter - 1;
  const auto lost = static_cast<std::uint64_t>(joined ? row.counter - study.next_counter : 0);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const bool valid = axis < 3 ? row.gyro_valid : row.accel_valid;
    for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {
      auto& stream = study.tracks[axis][static_cast<std::size_t>(regime)].recent;
      if (study.started && !joined) stream.gap();
      stream.miss(lost);
      // To the one regime, a sample of the other is missing.
      if (valid && row.regime == regime)
        stream.push(axis < 3 ? row.e_gyro_radps[axis] : row.e_accel_mps2[axis - 3]);
      else
        stream.miss(1);
    }
  }
  study.started = true;
  study.next_counter = row.counter + 1;
}

void ModelBook::add(const ErrorRecord& record) {
  auto& study = studies_[record.study];
  push(study, record.row);
  study.motion.add(record.row);
  ++study.samples;
  study.last_time = record.row.time;
  study.last_utc = record.row.utc;
  study.first_reference_time = record.first_reference_time;
  ++study.samples_since_refit;
}

std::optional<AxisRefit> ModelBook::refit_track(double rate_hz, Track& track, std::size_t axis,
                                                Regime regime) const {
  AxisRefit out;
  out.axis = axis;
  out.regime = regime;
  out.rate_hz = rate_hz;
  noise::WvSums window;
  window.levels.resize(static_cast<std::size_t>(noise::StreamingOptions{}.levels));
  track.recent.take(window);
  if (track.fit) out.change = noise::distance_from_model(window.wavelet_variance(), *track.fit);
  out.changed = out.change && out.change->p_value < kChangeLevel;
  track.before.merge(window);
  out.wv = track.before.wavelet_variance();
  if (out.wv.levels.empty()) return std::nullopt;
  const bool search = !track.fit || out.changed || out.wv.n_samples >= 2 * track.searched_at;
  noise::FitOptions options;
  options.signal_unit = axis_unit(axis);
  options.warm_start = search ? nullptr : &*track.fit;
  auto fitted = noise::fit(out.wv, spec_, rate_hz, options);
  if (!fitted) return out;
  if (search) track.searched_at = out.wv.n_samples;
  track.fit = std::move(*fitted);
  out.fit = track.fit;
  return out;
}

Refit ModelBook::fit(std::size_t index) {
  auto& study = studies_[index];
  const HostTime started = host_now();
  Refit refit;
  refit.study = index;
  refit.name = study.name;
  refit.time = study.last_time;
  refit.utc = study.last_utc;
  refit.first_reference_time = study.first_reference_time;
  refit.motion = study.motion.message();
  refit.samples = study.samples;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {
      auto& track = study.tracks[axis][static_cast<std::size_t>(regime)];
      if (auto refitted = refit_track(study.rate_hz, track, axis, regime))
        refit.axes.push_back(std::move(*refitted));
    }
  }
  refit.duration_s = to_seconds(host_now() - started);
  return refit;
}

std::optional<Refit> ModelBook::refit() {
  for (std::size_t i = 0; i < studies_.size(); ++i) {
    if (studies_[i].samples_since_refit < studies_[i].samples_per_refit) continue;
    studies_[i].samples_since_refit = 0;
    return fit(i);
  }
  return std::nullopt;
}

Modeller::Modeller(const Configuration& configuration, noise::ModelSpec spec)
    : book_(configuration, std::move(spec)), blocks_(std::make_unique<BlockRing>()) {}

Modeller::~Modeller() {
  stop();
  for (RowBlock* block = nullptr; blocks_->try_pop(block);) delete block;
}

void Modeller::start(const ThreadPlan& plan) {
  running_.store(true, std::memory_order_release);
  thread_ = std::thread([this, plan] {
    // The lowest priority is never refused in a way that matters: without it the thread runs as any other.
    (void)setup_this_thread(plan);
    loop();
    // What is left is waited for, even where stop() came before this thread had become idle.
    (void)setup_this_thread({plan.name, Scheduling::kNormal, 0, {}});
    drain();
  });
}

void Modeller::set_options(noise::ModelSpec spec, double refit_interval_s) {
  const std::lock_guard lock(mutex_);
  new_options_ = Options{std::move(spec), refit_interval_s};
}

void Modeller::stop() {
  hand_over();
  running_.store(false, std::memory_order_release);
  if (!thread_.joinable()) return;
  // The end of the run waits for it now: on a busy PC an idle thread's last fit would take minutes.
  run_as(thread_, Scheduling::kNormal);
  thread_.join();
}

void Modeller::add(const ErrorRecord& record) {
  if (!filling_) {
    filling_ = std::make_unique<RowBlock>();
    filling_->reserve(kRowsPerBlock);
  }
  filling_->push_back(record);
  ++rows_added_;
  if (filling_->size() == kRowsPerBlock) hand_over();
}

void Modeller::hand_over() {
  if (!filling_) return;
  if (blocks_->try_push(filling_.get())) {
    (void)filling_.release();
  } else {
    rows_refused_ += filling_->size();
  }
  filling_.reset();
  keep_up();
}

void Modeller::keep_up() {
  if (!thread_.joinable()) return;
  const auto waiting = blocks_->counters().level;
  if (!hurries_ && waiting >= kBlocksBehind) {
    run_as(thread_, Scheduling::kNormal);
    hurries_ = true;
  } else if (hurries_ && waiting <= 1) {
    run_as(thread_, Scheduling::kIdle);
    hurries_ = false;
  }
}

RingCounters Modeller::rows() const {
  const auto blocks = blocks_->counters();
  return {rows_added_ - rows_refused_, rows_refused_, blocks.level * kRowsPerBlock,
          blocks.high_water * kRowsPerBlock};
}

std::vector<Refit> Modeller::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(refits_, {});
}

void Modeller::drain() {
  std::optional<Options> options;
  {
    const std::lock_guard lock(mutex_);
    options = std::exchange(new_options_, std::nullopt);
  }
  if (options) book_.set_options(std::move(options->spec), options->refit_interval_s);
  for (RowBlock* next = nullptr; blocks_->try_pop(next);) {
    const std::unique_ptr<RowBlock> block(next);
    for (const auto& record : *block) {
      book_.add(record);
      // At the very row, so that a replay fits the same samples.
      while (auto refit = book_.refit()) {
        const std::lock_guard lock(mutex_);
        refits_.push_back(std::move(*refit));
      }
    }
  }
}

void Modeller::loop() {
  while (running_.load(std::memory_order_acquire)) {
    heartbeat_.beat(host_now());
    drain();
    std::this_thread::sleep_for(kIdleSleep);
  }
}

}  // namespace imuscope
