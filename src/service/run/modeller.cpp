#include "service/run/modeller.h"

#include <chrono>
#include <utility>

#include "rt/host_clock.h"
#include "service/run/models_file.h"

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

Modeller::Modeller(const Configuration& configuration, noise::ModelSpec spec)
    : models_(configuration, std::move(spec),
              [this](Refit refit) {
                const std::lock_guard lock(mutex_);
                refits_.push_back(std::move(refit));
              }),
      blocks_(std::make_unique<BlockRing>()) {}

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
    models_.finish();
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
    filling_->reserve(kRowsPerModellerBlock);
  }
  filling_->push_back(record);
  ++rows_added_;
  if (filling_->size() == kRowsPerModellerBlock) hand_over();
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
  return {rows_added_ - rows_refused_, rows_refused_, blocks.level * kRowsPerModellerBlock,
          blocks.high_water * kRowsPerModellerBlock};
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
  if (options) models_.set_options(std::move(options->spec), options->refit_interval_s);
  for (RowBlock* next = nullptr; blocks_->try_pop(next);) {
    const std::unique_ptr<RowBlock> block(next);
    for (const auto& record : *block) models_.add(record);
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
