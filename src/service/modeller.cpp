#include "service/modeller.h"

#include <chrono>
#include <cmath>

#include "noise/fit.h"
#include "noise/wavelet_variance.h"
#include "rt/host_clock.h"
#include "service/report_values.h"

namespace imuscope {

namespace {

constexpr auto kIdleSleep = std::chrono::milliseconds(50);

}  // namespace

ModelBook::ModelBook(const Configuration& configuration, noise::ModelSpec spec) : spec_(std::move(spec)) {
  for (const auto index : configuration.study_indices()) {
    const auto& device = configuration.devices[index];
    Study study;
    study.name = device.name;
    study.rate_hz = device.rate_hz;
    study.samples_per_refit =
        static_cast<std::size_t>(std::llround(configuration.noise.refit_interval_s * device.rate_hz));
    studies_.push_back(std::move(study));
  }
}

void ModelBook::add(const ErrorRecord& record) {
  auto& study = studies_[record.study];
  study.series.add(record.row);
  study.last_time = record.row.time;
  study.first_reference_time = record.first_reference_time;
  ++study.samples_since_refit;
}

std::optional<Refit> ModelBook::refit() {
  for (std::size_t i = 0; i < studies_.size(); ++i) {
    auto& study = studies_[i];
    if (study.samples_since_refit < study.samples_per_refit) continue;
    study.samples_since_refit = 0;
    const HostTime started = host_now();
    Refit refit{i, study.last_time, study.first_reference_time, {}, {}, 0.0};
    refit.wavelet_variance.name = study.name;
    refit.noise_model.name = study.name;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {
        noise::WvOptions options;
        const auto mask = study.series.mask(axis, regime);
        options.mask = mask;
        const auto wv = noise::haar_wavelet_variance(study.series.values(axis), options);
        if (!wv) continue;  // a regime that has not been met yet has no model
        refit.wavelet_variance.axes.push_back(axis_wavelet_variance(*wv, axis, regime, study.rate_hz));
        noise::FitOptions fit_options;
        fit_options.signal_unit = axis_unit(axis);
        const auto fit = noise::fit(*wv, spec_, study.rate_hz, fit_options);
        if (fit) refit.noise_model.models.push_back(axis_noise_model(*fit, axis, regime));
      }
    }
    refit.duration_s = to_seconds(host_now() - started);
    return refit;
  }
  return std::nullopt;
}

Modeller::Modeller(const Configuration& configuration, noise::ModelSpec spec)
    : book_(configuration, std::move(spec)), rows_(std::make_unique<RowRing>()) {}

Modeller::~Modeller() { stop(); }

void Modeller::start(const ThreadPlan& plan) {
  running_.store(true, std::memory_order_release);
  thread_ = std::thread([this, plan] {
    // The lowest priority is never refused in a way that matters: without it the thread runs as any other.
    (void)setup_this_thread(plan);
    loop();
  });
}

void Modeller::stop() {
  running_.store(false, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

std::vector<Refit> Modeller::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(refits_, {});
}

void Modeller::drain() {
  ErrorRecord record;
  while (rows_->try_pop(record)) book_.add(record);
  while (auto refit = book_.refit()) {
    const std::lock_guard lock(mutex_);
    refits_.push_back(std::move(*refit));
  }
}

void Modeller::loop() {
  while (running_.load(std::memory_order_acquire)) {
    drain();
    std::this_thread::sleep_for(kIdleSleep);
  }
  drain();
}

}  // namespace imuscope
