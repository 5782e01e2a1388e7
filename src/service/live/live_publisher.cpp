#include "service/live/live_publisher.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <fstream>
#include <imuscope/event_t.hpp>
#include <utility>

#include "base/units.h"
#include "publish/message_codec.h"
#include "rt/host_clock.h"
#include "service/doors/journal.h"
#include "service/pipeline/estimator_setup.h"
#include "service/pipeline/noise_feedback.h"
#include "service/run/describe.h"
#include "service/run/run_record.h"

namespace imuscope {

namespace {

/// What the core has put out waits at most this long; each turn costs a wake-up and, for the messages sent in
/// it, one of every listener.
constexpr Duration kDrainPeriod = std::chrono::milliseconds(50);
/// A person's events are looked for in every so many turns.
constexpr std::uint64_t kTurnsPerEar = 2;
constexpr Duration kStatusMessagePeriod = std::chrono::seconds(1);
/// Is there a route to the bus, and the same one?
constexpr Duration kBusPeriod = std::chrono::seconds(2);

constexpr std::array kSessionNames{"connecting", "configuring", "streaming", "failed"};

std::string state_name(const LineStatus& status) {
  switch (status.line) {
    case LineState::kClosed:
      return "no line";
    case LineState::kDown:
      return "line down";
    case LineState::kOpen:
      break;
  }
  return kSessionNames[static_cast<std::size_t>(status.session)];
}

std::uint64_t resident_memory_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::uint64_t total = 0;
  std::uint64_t resident = 0;
  statm >> total >> resident;
  return resident * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

std::int64_t as_count(std::uint64_t count) { return static_cast<std::int64_t>(count); }

ring_status_t ring_status(const char* name, std::size_t capacity, const RingCounters& counters) {
  ring_status_t status{};
  status.name = name;
  status.capacity = as_count(capacity);
  status.level = as_count(counters.level);
  status.high_water = as_count(counters.high_water);
  status.refused = as_count(counters.refused);
  return status;
}

template <typename Ring>
ring_status_t ring_status(const char* name, const Ring& ring) {
  return ring_status(name, ring.capacity(), ring.counters());
}

}  // namespace

LivePublisher::LivePublisher(const Configuration& configuration, noise::ModelSpec spec,
                             const LiveOptions& options, IoThread& io, CoreThread& estimator)
    : configuration_(configuration),
      options_(options),
      io_(io),
      estimator_(estimator),
      study_devices_(configuration.study_indices()),
      estimator_config_(estimator_config(configuration)),
      tunables_{configuration.lcm, configuration.noise, spec},
      broadcast_(configuration),
      modeller_(configuration, std::move(spec)),
      watches_(configuration.devices.size()),
      lines_(configuration.devices.size()),
      can_watches_(configuration.devices.size()),
      line_problems_(configuration.devices.size()),
      clock_keepers_([folder = options.out] { return ask_clock_keepers(folder); }),
      study_states_(study_devices_.size(), CalibrationStatus::kWaiting),
      observability_(study_devices_.size()),
      started_(host_now()),
      last_status_(started_) {
  for (const auto& study : estimator_config_.studies)
    feedback_.emplace_back(study.noise, study.noise_floor_share);
}

LivePublisher::~LivePublisher() {
  running_.store(false, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

Result<std::unique_ptr<LivePublisher>> LivePublisher::create(const Configuration& configuration,
                                                             noise::ModelSpec spec,
                                                             const LiveOptions& options, IoThread& io,
                                                             CoreThread& estimator) {
  std::unique_ptr<LivePublisher> publisher(
      new LivePublisher(configuration, std::move(spec), options, io, estimator));
  std::vector<SImuFileInfo> infos;
  for (const auto index : publisher->study_devices_)
    infos.push_back({configuration.devices[index].name, 0.0});
  auto folder = RunFolder::create(options.out, std::move(infos), true);
  if (!folder) return tl::unexpected<Error>(folder.error());
  publisher->folder_ = std::move(*folder);
  if (auto url = parse_udpm_url(configuration.lcm.url); !url) return tl::unexpected<Error>(url.error());
  publisher->open_bus();
  return publisher;
}

Result<void> LivePublisher::smooth(LiveHistory& history, const EstimatorConfig& estimator) {
  std::vector<std::uint32_t> blocks;
  for (const auto& study : estimator.studies) blocks.push_back(study.blocks);
  smoothing_.emplace(history, blocks);
  std::vector<SImuFileInfo> infos;
  for (const auto index : study_devices_) infos.push_back({configuration_.devices[index].name, 0.0});
  return smoothing_->open(folder_->folder(), std::move(infos));
}

/// What is published is recorded, whether or not there is a bus.
void LivePublisher::open_bus() {
  broadcast_.open(LcmPublisher::unconnected(tunables_.lcm.channel_prefix), tunables_.lcm.bridge);
  if (recorder_ != nullptr) set_recorder(*recorder_);
  connected_ = false;
  ear_.reset();
  bus_problem_.clear();
  watch_bus();
}

/// Takes the bus when it is there: a route may come after the start, go, and lead another way.
void LivePublisher::watch_bus() {
  const auto& url = tunables_.lcm.url;
  // A bus alone, not a log: liblcm would write over the file that the configuration names.
  const auto bus = check_lcm_bus(url);
  if (!bus) {
    ear_.reset();
    tell_bus_problem("nothing is published over LCM: " + bus.error().text());
    return;
  }
  if (ear_ && bus->local == heard_on_) return;
  // Once it is connected each message finds its own way.
  if (!connected_) {
    if (auto connected = broadcast_.connect(url); !connected) {
      tell_bus_problem("nothing is published over LCM: " + connected.error().text());
      return;
    }
    connected_ = true;
  }
  if (auto heard = listen_for_events(); !heard) {
    ear_.reset();
    tell_bus_problem("a person's events are not heard: " + heard.error().text());
    return;
  }
  heard_on_ = bus->local;
  if (!bus_problem_.empty()) spdlog::info("the LCM bus is there");
  bus_problem_.clear();
}

void LivePublisher::tell_bus_problem(const std::string& problem) {
  if (problem != bus_problem_) spdlog::warn("{}", problem);
  bus_problem_ = problem;
}

Result<void> LivePublisher::listen_for_events() {
  auto ear = LcmListener::open(tunables_.lcm.url, tunables_.lcm.channel_prefix);
  if (!ear) return tl::unexpected<Error>(ear.error());
  ear_.emplace(std::move(*ear));
  return ear_->subscribe("EVENT", [this](const std::string& channel, std::span<const std::uint8_t> bytes) {
    on_person_event(channel, bytes);
  });
}

void LivePublisher::set_recorder(Recorder& recorder) {
  recorder_ = &recorder;
  broadcast_.set_tap(
      [this](std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> message) {
        recorder_->record_message(channel, utime, message);
        if (bag_ != nullptr) bag_->on_message(channel, utime, message);
      });
}

void LivePublisher::on_person_event(const std::string& channel, std::span<const std::uint8_t> bytes) {
  // It may have waited for this thread's turn.
  const HostTime heard = host_now() - ear_->age();
  if (!event_gate_.take(bytes.size(), heard)) return;
  const auto event = decode_message<event_t>(bytes);
  if (!event) {
    spdlog::warn("a message on {} is no event_t of this version; it was recorded as it came", channel);
  } else {
    last_event_ = event->text;
    spdlog::info("event: {} (from {})", event->text, event->source);
  }
  // By the time at which it was heard: the sender's clock may be another PC's.
  if (recorder_ != nullptr) recorder_->record_heard(channel, heard, bytes);
  if (bag_ != nullptr) bag_->on_message(channel, to_utime(utc_at(heard)), bytes);
}

void LivePublisher::reconfigure(const Tunables& tunables) {
  const std::lock_guard lock(shared_mutex_);
  new_tunables_ = tunables;
}

void LivePublisher::take_over_tunables() {
  std::optional<Tunables> tunables;
  {
    const std::lock_guard lock(shared_mutex_);
    tunables = std::exchange(new_tunables_, std::nullopt);
  }
  if (!tunables) return;
  tunables_ = std::move(*tunables);
  modeller_.set_options(tunables_.model, tunables_.noise.refit_interval_s);
  open_bus();
}

Health LivePublisher::health() const {
  const std::lock_guard lock(shared_mutex_);
  return health_;
}

std::vector<Pulse> LivePublisher::pulses() const {
  std::vector<Pulse> pulses{
      {kIoThreadName, &io_.heartbeat(), kCoreTold, kCoreGivenUp},
      {kEstimatorThreadName, &estimator_.heartbeat(), kCoreTold, kCoreGivenUp},
      {kPublisherThreadName, &heartbeat_, kWriterTold, kWriterGivenUp},
      {kModellerThreadName, &modeller_.heartbeat(), kModellerTold, kModellerGivenUp},
  };
  if (recorder_ != nullptr)
    pulses.push_back({kRecorderThreadName, &recorder_->heartbeat(), kWriterTold, kWriterGivenUp});
  if (bag_ != nullptr) pulses.push_back({kBagThreadName, &bag_->heartbeat(), kWriterTold, kWriterGivenUp});
  return pulses;
}

void LivePublisher::set_refusals(const std::vector<Error>& refusals) {
  const std::lock_guard lock(shared_mutex_);
  refusals_ = refusals;
}

void LivePublisher::watch_can(const std::vector<std::vector<CanId>>& ids) {
  for (std::size_t i = 0; i < can_watches_.size(); ++i) {
    const auto& can = configuration_.devices[i].can;
    if (can) can_watches_[i].emplace(can->interface, ids[i]);
  }
}

void LivePublisher::set_line_problem(DeviceIndex device, const std::string& problem) {
  const std::lock_guard lock(line_problems_mutex_);
  line_problems_[device] = problem;
}

std::string LivePublisher::problem_of(std::size_t device, HostTime now) {
  {
    const std::lock_guard lock(line_problems_mutex_);
    if (!line_problems_[device].empty()) return line_problems_[device];
  }
  if (can_watches_[device]) {
    if (auto problem = can_watches_[device]->look(lines_[device], now); !problem.empty()) return problem;
  }
  return lines_[device].problem.data();
}

void LivePublisher::start() {
  modeller_.start({kModellerThreadName, Scheduling::kIdle, 0, {}});
  running_.store(true, std::memory_order_release);
  thread_ = std::thread([this] {
    (void)setup_this_thread({kPublisherThreadName, Scheduling::kNormal, 0, {}});
    loop();
  });
}

void LivePublisher::loop() {
  PeriodicLoop beat(host_now(), kDrainPeriod);
  std::uint64_t turn = 0;
  while (running_.load(std::memory_order_acquire)) {
    (void)beat.wait();
    beat_ = beat.statistics();
    take_over_tunables();
    drain();
    if (ear_ && ++turn % kTurnsPerEar == 0) (void)ear_->wait(std::chrono::milliseconds(0));
    const HostTime now = host_now();
    heartbeat_.beat(now);
    if (const auto refused = event_gate_.due_report(now); refused > 0) {
      spdlog::warn(
          "{} events were neither logged nor recorded: more come on {}_EVENT than a person marks, or "
          "longer ones; find who sends them",
          refused, tunables_.lcm.channel_prefix);
    }
    watch_pc_clock(now);
    if (now - bus_looked_ >= kBusPeriod) {
      watch_bus();
      bus_looked_ = now;
    }
    if (now - last_status_ >= kStatusMessagePeriod) {
      watch_devices(now);
      publish_status(now);
      last_status_ = now;
    }
  }
}

void LivePublisher::drain() {
  auto& rings = estimator_.rings();
  EstimatorEvent event;
  while (rings.events.try_pop(event)) {
    spdlog::info("{}", describe(configuration_, event));
    folder_->on_event(event);
  }
  ErrorRecord record;
  while (rings.errors.try_pop(record)) on_error(record);
  while (const Snapshot* snapshot = rings.snapshots.front()) {
    on_snapshot(*snapshot);
    rings.snapshots.pop();
  }
  if (smoothing_ && last_) smoothing_->drain(*last_, folder_->utc());
  AppliedNoise applied;
  while (rings.noises.try_pop(applied)) on_noise_applied(applied);
  for (const auto& refit : modeller_.take()) on_refit(refit);
}

void LivePublisher::on_noise_applied(const AppliedNoise& applied) {
  const auto& name = configuration_.devices[study_devices_[applied.study]].name;
  spdlog::info("{}: the filter took over version {} of the noise model at tick {}", name,
               applied.model.version, applied.tick);
  if (recorder_ == nullptr) return;
  auto record = applied_model_record(applied, name);
  record.utime = to_utime(wall_clock_now());
  record.sequence = applied_++;
  recorder_->record_message(channel_name(configuration_.lcm.channel_prefix, "APPLIED_MODEL"), record.utime,
                            encode_message(record));
}

void LivePublisher::on_error(const ErrorRecord& record) {
  folder_->on_error(record);
  modeller_.add(record);
  broadcast_.on_error(record);
}

void LivePublisher::on_snapshot(const Snapshot& snapshot) {
  last_ = snapshot;
  if (const auto line = minute_line_.look(snapshot)) spdlog::info("{}", *line);
  if (bag_ != nullptr) bag_->on_snapshot(snapshot);
  folder_->on_snapshot(snapshot);
  broadcast_.on_snapshot(snapshot);
  for (std::size_t i = 0; i < snapshot.n_studies; ++i) {
    const auto& name = configuration_.devices[study_devices_[i]].name;
    const auto state = snapshot.studies[i].status;
    if (state != study_states_[i]) spdlog::info("{}: {}", name, words_of(state));
    study_states_[i] = state;
    for (const auto& sentence : observability_[i].update(snapshot.studies[i]))
      spdlog::info("{}: {}", name, sentence);
  }
}

void LivePublisher::on_refit(const Refit& refit) {
  ++refits_;
  refit_duration_s_ = refit.duration_s;
  refit_utc_ = utc_at(host_now());
  models_.take(refit);
  if (bag_ != nullptr) bag_->on_refit(refit);
  // At each refit, not only at the end: a run that is killed leaves its newest models.
  if (auto written = models_.write(folder_->folder()); !written) spdlog::error("{}", written.error().text());
  if (tunables_.noise.apply_to_filter) {
    if (const auto accepted = feedback_[refit.study].consider(refit))
      estimator_.offer_noise(refit.study, *accepted);
  }
  broadcast_.on_refit(refit);
  const auto n_fits = std::count_if(refit.axes.begin(), refit.axes.end(),
                                    [](const AxisRefit& axis) { return axis.fit.has_value(); });
  spdlog::info("{}: noise models fitted anew ({} of them, {:.0f} ms)", refit.name, n_fits,
               refit.duration_s * 1e3);
  for (const AxisRefit& axis : refit.axes) {
    if (!axis.fit || !axis.changed) continue;
    spdlog::warn("{}: {} ({}) behaves differently since the last refit (p = {:.1g})", refit.name,
                 axis_name(axis.axis), regime_name(axis.regime), axis.change->p_value);
  }
}

void LivePublisher::watch_devices(HostTime now) {
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const auto status = io_.status(static_cast<DeviceIndex>(i));
    lines_[i] = status;
    auto& watch = watches_[i];
    const auto& name = configuration_.devices[i].name;
    const double seconds = std::max(to_seconds(now - last_status_), 1e-3);
    watch.rate_hz = static_cast<double>(status.epochs - watch.epochs) / seconds;
    watch.epochs = status.epochs;
    const std::string problem = problem_of(i, now);
    if (problem != watch.problem && !problem.empty()) spdlog::warn("{}: {}", name, problem);
    watch.problem = problem;
    if (status.session != watch.session) {
      spdlog::info("{}: {}", name, kSessionNames[static_cast<std::size_t>(status.session)]);
      watch.session = status.session;
    }
  }
}

void LivePublisher::fill_device(std::size_t index, device_status_t& device, HostTime now) const {
  const auto& line = lines_[index];
  if (line.last_arrival > HostTime{}) device.data_age_s = std::max(0.0, to_seconds(now - line.last_arrival));
  device.state = state_name(line);
  device.problem = watches_[index].problem;
  device.rate_hz = watches_[index].rate_hz;
  device.bytes = as_count(line.counters.bytes);
  device.bytes_skipped = as_count(line.counters.bytes_skipped);
  device.frames = as_count(line.counters.frames);
  device.frames_dropped = as_count(line.frames_dropped);
  device.bad_checksums = as_count(line.counters.bad_checksums);
  device.samples = as_count(line.counters.samples);
  device.samples_lost = as_count(line.counters.samples_lost);
  device.samples_refused = as_count(line.refused);
  device.clock_resets = as_count(line.counters.clock_resets);
  const SImuOutput* const study = study_of(index);
  if (study != nullptr) device.samples_late = as_count(study->counters.late);
  set_time_budget(time_budget(line, study, configuration_.devices[index].role,
                              last_ ? last_->time_scale.pulses : PulseState{}),
                  device);
}

/// The newest estimate of an S-IMU; null for other devices and before the first.
const SImuOutput* LivePublisher::study_of(std::size_t index) const {
  const auto study = std::find(study_devices_.begin(), study_devices_.end(), index);
  if (!last_ || study == study_devices_.end()) return nullptr;
  return &last_->studies[static_cast<std::size_t>(study - study_devices_.begin())];
}

/// The beats of the threads that have one, by the threads' names.
void LivePublisher::add_threads(status_t& status, HostTime now) {
  status.threads = threads_.look(now);
  const auto add_beat = [&](std::string_view name, const PeriodicStatistics& beat, Duration before_deadline) {
    const auto found = std::find_if(status.threads.begin(), status.threads.end(),
                                    [&](const auto& thread) { return thread.name == name; });
    if (found != status.threads.end()) set_beat(beat, before_deadline, *found);
  };
  add_beat(kEstimatorThreadName, estimator_.statistics(), CoreThread::kGuard);
  add_beat(kIoThreadName, io_.statistics(), Duration::zero());
  add_beat(kPublisherThreadName, beat_, Duration::zero());
  for (const auto& pulse : pulses()) {
    const auto found = std::find_if(status.threads.begin(), status.threads.end(),
                                    [&](const auto& thread) { return thread.name == pulse.thread; });
    if (found != status.threads.end())
      found->heartbeat_age_s = std::max(0.0, to_seconds(now - pulse.heartbeat->last()));
  }
}

void LivePublisher::add_rings(status_t& status) {
  auto& rings = estimator_.rings();
  status.rings.push_back(ring_status("errors", rings.errors));
  status.rings.push_back(ring_status("snapshots", rings.snapshots));
  status.rings.push_back(ring_status("events", rings.events));
  status.rings.push_back(ring_status("applied models", rings.noises));
  status.rings.push_back(ring_status("exceptions", rings.exceptions));
  status.rings.push_back(ring_status("raw bytes", io_.raw_ring()));
  status.rings.push_back(ring_status("modeller", Modeller::row_capacity(), modeller_.rows()));
}

/// By the PC's clock until there is a first result.
UtcTime LivePublisher::utc_at(HostTime time) const {
  const UtcStamp stamp = broadcast_.utc_at(time);
  return stamp.is_known ? stamp.utc : wall_clock_now() + (time - host_now());
}

status_t LivePublisher::status(HostTime now) {
  constexpr double kBytesPerMb = 1e6;
  status_t status = status_of(configuration_, options_.version);
  status.utime = to_utime(utc_at(now));
  set_time_scale(last_ ? last_->time_scale : TimeScale{}, status);
  status.uptime_s = to_seconds(now - started_);
  status.tick = estimator_.last_tick();
  status.refits = refits_;
  status.refit_duration_s = refit_duration_s_;
  status.refit_utime = refit_utc_ ? to_utime(*refit_utc_) : 0;
  status.resident_memory_mb = static_cast<double>(resident_memory_bytes()) / kBytesPerMb;
  status.last_event = last_event_;
  if (recorder_ != nullptr) {
    const auto recorded = recorder_->status();
    status.capture_path = recorded.path.string();
    status.capture_bytes = as_count(recorded.bytes);
    status.capture_lost =
        as_count(recorded.records_lost + recorded.messages_lost + io_.raw_ring().counters().refused);
  }
  for (std::size_t i = 0; i < lines_.size(); ++i) fill_device(i, status.devices[i], now);
  for (std::size_t i = 0; i < study_devices_.size(); ++i) {
    status.studies.push_back(study_status(configuration_.devices[study_devices_[i]].name,
                                          last_ ? last_->studies[i] : SImuOutput{}));
  }
  add_threads(status, now);
  add_rings(status);
  add_alarms(status, now);
  const std::lock_guard lock(shared_mutex_);
  health_ = judge(status);
  status.state = health_.state;
  status.reason = health_.reason;
  return status;
}

void LivePublisher::add_alarms(status_t& status, HostTime now) {
  std::vector<Condition> holding = standing_threads(pulses(), now);
  const auto add = [&holding](Condition condition) { holding.push_back(std::move(condition)); };
  const auto add_disk = [&add](const char* subject, const std::optional<Error>& problem) {
    if (problem) add({alarm_kind::kDisk, subject, problem->what, problem->remedy});
  };
  if (recorder_ != nullptr) add_disk("capture", recorder_->status().problem);
  add_disk("results", folder_->problem());
  if (bag_ != nullptr) add_disk(kBagFileName, bag_->problem());
  if (!bus_problem_.empty()) add(condition_of(alarm_kind::kBus, "LCM", bus_problem_));
  {
    const std::lock_guard lock(shared_mutex_);
    for (const auto& refusal : refusals_)
      add({alarm_kind::kPrivilege, refusal.what, refusal.what, refusal.remedy});
  }
  for (auto& condition : conditions_of(status, growing_, now)) add(std::move(condition));
  const auto news = alarms_.look(holding, utc_at(now), now);
  for (const auto& alarm : news.began) {
    tell_alarm(alarm);
    // The others have their words in the log where they happen.
    if (alarm.kind == alarm_kind::kDisk) spdlog::warn("{}; {}", alarm.what, alarm.remedy);
  }
  for (const auto& alarm : news.ended) {
    tell_alarm(alarm);
    if (alarm.kind == alarm_kind::kDisk)
      spdlog::info("{}: can be written again after {:.0f} s", alarm.subject, alarm.lasted_s);
  }
  status.alarms = alarms_.list();
}

void LivePublisher::watch_pc_clock(HostTime now) {
  if (auto keepers = clock_keepers_.take()) {
    const auto news = pc_clock_.take(std::move(*keepers));
    broadcast_.on_pc_clock(news, utc_at(news.state.reading.host));
  }
  const auto news = pc_clock_.look(now);
  if (!news) return;
  clock_keepers_.begin();
  if (news->suspend) {
    spdlog::warn(
        "this PC was suspended for {:.1f} s: what the devices sent meanwhile is lost, and their clocks "
        "begin anew; keep it awake while it records (systemd-inhibit)",
        news->suspend->length_s);
  }
  if (news->step) {
    spdlog::warn(
        "this PC's wall clock was stepped by {:+.6f} s; times and labels of this run go on as they were",
        news->step->size_s);
  }
  broadcast_.on_pc_clock(*news, utc_at(news->state.reading.host));
}

void LivePublisher::publish_status(HostTime now) {
  status_t newest = status(now);
  count_elements(newest);
  board_.put(newest, now);
  broadcast_.on_status(std::move(newest));
}

Result<void> LivePublisher::finish(std::int64_t last_tick) {
  running_.store(false, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
  drain();
  modeller_.stop();
  drain();
  broadcast_.finish();
  watch_devices(host_now());
  publish_status(host_now());
  // Whatever the disk refuses of one file, the others are written, and run.json says what is not whole.
  std::vector<Error> refused;
  const auto note = [&refused](const Result<void>& written) {
    if (!written) refused.push_back(written.error());
  };
  note(folder_->write_calibration());
  note(folder_->close());
  if (smoothing_) note(smoothing_->close());

  RunRecord run{configuration_, options_.version,          {"live"},         {},
                last_tick + 1,  last_ ? &*last_ : nullptr, folder_->events()};
  run.utc = &folder_->utc();
  run.pc_clock = &pc_clock_.record();
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const LineStatus& line = lines_[i];
    DeviceRecord device;
    device.time_budget = time_budget(line, study_of(i), configuration_.devices[i].role,
                                     last_ ? last_->time_scale.pulses : PulseState{});
    device.counters = line.counters;
    device.refused = line.refused;
    device.frames_dropped = line.frames_dropped;
    device.problem = line.problem.data();
    run.devices.push_back(std::move(device));
  }
  for (const auto& error : refused) run.warnings.push_back(error.text());
  note(write_run_record(folder_->folder(), run));
  if (refused.empty()) return {};
  return tl::unexpected<Error>(refused.front());
}

}  // namespace imuscope
