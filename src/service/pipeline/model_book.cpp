#include "service/pipeline/model_book.h"

#include <cmath>
#include <utility>

#include "models/noise/fit.h"
#include "models/noise/replicates.h"
#include "rt/host_clock.h"

namespace imuscope {

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

void ModelBook::push(Study& study, const ErrorRow& row, std::optional<Regime> regime) {
  const bool joined = study.started && row.counter > study.next_counter - 1;
  const auto lost = static_cast<std::uint64_t>(joined ? row.counter - study.next_counter : 0);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const bool valid = axis < 3 ? row.gyro_valid : row.accel_valid;
    for (const Regime one : {Regime::kStatic, Regime::kDynamic}) {
      auto& stream = study.tracks[axis][static_cast<std::size_t>(one)].recent;
      if (study.started && !joined) stream.gap();
      stream.miss(lost);
      // To the one regime, a sample of the other is missing.
      if (valid && regime == one)
        stream.push(axis < 3 ? row.e_gyro_radps[axis] : row.e_accel_mps2[axis - 3]);
      else
        stream.miss(1);
    }
  }
  study.started = true;
  study.next_counter = row.counter + 1;
}

void ModelBook::add(const ErrorRecord& record, std::optional<Regime> regime) {
  auto& study = studies_[record.study];
  push(study, record.row, regime);
  if (regime) study.motion.add(record.row, *regime);
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
  refit.motion = study.motion.summary();
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

}  // namespace imuscope
