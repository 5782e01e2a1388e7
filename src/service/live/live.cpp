#include "service/live/live.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <algorithm>
#include <chrono>
#include <fstream>

#include "capture/recorder.h"
#include "models/noise/model.h"
#include "rt/host_clock.h"
#include "rt/thread_setup.h"
#include "service/doors/journal.h"
#include "service/doors/metrics_server.h"
#include "service/doors/status_socket.h"
#include "service/lines/baud_search.h"
#include "service/lines/device_events.h"
#include "service/lines/io_thread.h"
#include "service/lines/line_factory.h"
#include "service/lines/line_opener.h"
#include "service/lines/line_rate.h"
#include "service/live/controlling_terminal.h"
#include "service/live/live_publisher.h"
#include "service/live/pulse.h"
#include "service/live/reload.h"
#include "service/live/retention.h"
#include "service/live/systemd_notify.h"
#include "service/pipeline/core_thread.h"
#include "service/pipeline/device_factory.h"
#include "service/pipeline/estimator_setup.h"
#include "service/run/live_smoothing.h"
#include "service/run/new_folder.h"

namespace imuscope {

namespace {

constexpr int kIoPriority = 80;
constexpr int kEstimatorPriority = 70;
/// Stacks are locked in full; the deepest core call needs far less.
constexpr std::size_t kThreadStackBytes = 1024 * 1024;
constexpr auto kSupervisorPeriod = std::chrono::milliseconds(200);
constexpr Duration kReopenFirst = std::chrono::milliseconds(200);
constexpr Duration kReopenLongest = std::chrono::seconds(5);
/// An attempt to open that takes longer than a TCP connection is given is told.
constexpr Duration kOpensWithin = std::chrono::seconds(3);
/// From now to tick 0: the threads start meanwhile.
constexpr Duration kStartDelay = std::chrono::milliseconds(100);

/// Opens lines, again and again with growing pauses where they are missing, and tells what changed.
class Supervisor {
 public:
  /// @param ids  per device, what its decoder needs of a CAN bus
  Supervisor(const Configuration& configuration, std::vector<std::vector<CanId>> ids, IoThread& io,
             LivePublisher& publisher)
      : configuration_(configuration), ids_(std::move(ids)), io_(io), publisher_(publisher) {
    lines_.resize(configuration.devices.size());
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      if (const auto& serial = configuration.devices[i].serial) lines_[i].baud = BaudSearch(serial->baud);
    }
  }

  void step(HostTime now) {
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      if (configuration_.devices[i].line_owner == i) step_line(static_cast<DeviceIndex>(i), now);
    }
  }

  /// A device has come: lines that are missing are tried without a pause, and again soon where it is not
  /// ready yet.
  void try_at_once() {
    for (auto& line : lines_) {
      line.next_try = HostTime{};
      line.pause = kReopenFirst;
    }
  }

 private:
  struct Line {
    bool open = false;
    HostTime next_try{};
    Duration pause = kReopenFirst;
    std::string last_problem;
    BaudSearch baud;
    LineOpener opener;
    HostTime began{};  ///< the attempt that is under way
  };

  void step_line(DeviceIndex index, HostTime now) {
    auto& line = lines_[index];
    DeviceConfig device = configuration_.devices[index];
    if (auto gone = io_.take_back(index)) {
      if (device.serial && gone->session->wants_other_baud()) {
        line.baud.next();
        // The first round is told; a device that is switched off would fill the log for ever.
        if (!line.baud.repeats()) {
          spdlog::warn(
              "{}: no answer at {}; check the device's power, its cable and the port; trying {} "
              "baud (once it answers, set baud to that)",
              device.name, gone->line->describe(), line.baud.current());
        }
      } else {
        spdlog::warn("{}: {} is gone; trying to open it again", device.name, gone->line->describe());
      }
      line.open = false;
      line.pause = kReopenFirst;
      line.next_try = now + line.pause;
    }
    if (device.serial) device.serial->baud = line.baud.current();
    if (line.opener.is_under_way()) {
      if (auto opened = line.opener.take()) {
        take_over(index, device, std::move(*opened), now);
      } else if (now - line.began > kOpensWithin) {
        tell(index, device, told_while_opening(device));
      }
      return;
    }
    if (line.open || now < line.next_try) return;
    line.began = now;
    line.opener.begin([device = std::move(device), ids = ids_[index]] { return open_line(device, ids); });
  }

  static std::string told_while_opening(const DeviceConfig& device) {
    if (!device.net) return "its port has not opened for seconds; unplug the device and plug it in again";
    return fmt::format(
        "{} has not been found for seconds: the name server does not answer; give the host's address in "
        "place of its name, or check the network",
        device.net->host);
  }

  /// Said once, and again when the reason changes: a log is no place for a heartbeat.
  void tell(DeviceIndex index, const DeviceConfig& device, const std::string& problem) {
    auto& line = lines_[index];
    if (problem != line.last_problem) {
      spdlog::error("{}: {}", device.name, problem);
      publisher_.set_line_problem(index, problem);
    }
    line.last_problem = problem;
  }

  void take_over(DeviceIndex index, const DeviceConfig& device, LineOpener::Outcome opened, HostTime now) {
    auto& line = lines_[index];
    if (!opened) {
      tell(index, device, opened.error().text());
      line.next_try = now + line.pause;
      line.pause = std::min(line.pause * 2, kReopenLongest);
      return;
    }
    if (!line.baud.repeats()) spdlog::info("{}: {} is open", device.name, (*opened)->describe());
    publisher_.set_line_problem(index, {});
    io_.offer(index, std::make_unique<Connection>(Connection{std::move(*opened),
                                                             make_session(device, line.baud.searching()),
                                                             device.serial.has_value()}));
    line.open = true;
    line.pause = kReopenFirst;
    line.last_problem.clear();
  }

  const Configuration& configuration_;
  std::vector<std::vector<CanId>> ids_;
  IoThread& io_;
  LivePublisher& publisher_;
  std::vector<Line> lines_;
};

/// Replays are exact for the same build on the same CPU model: the capture says which.
std::string processor_model() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  }
  return "unknown";
}

std::vector<std::string> device_names(const Configuration& configuration) {
  std::vector<std::string> names;
  for (const auto& device : configuration.devices) names.push_back(device.name);
  return names;
}

RunHeader run_header(const Configuration& configuration, const LiveOptions& options, HostTime t0) {
  RunHeader header;
  header.name = configuration.run_name;
  header.version = options.version;
  header.build = fmt::format("g++ {}", __VERSION__);
  header.processor = processor_model();
  header.t0 = t0;
  header.period = kTickPeriod;
  // As the capture keeps it, so that a replay knows the same.
  header.t0_wall = std::chrono::floor<std::chrono::microseconds>(wall_clock_now() + (t0 - host_now()));
  header.configuration = configuration.text;
  header.configuration_hash = configuration.sha256;
  header.devices = device_names(configuration);
  return header;
}

void log_refusals(const std::vector<Error>& refusals) {
  for (const auto& refusal : refusals) spdlog::warn("{}", refusal.text());
}

/// Says in the log which threads stand still, once each time: STATUS may be what stands still.
class StandingThreads {
 public:
  void look(std::span<const Pulse> pulses, HostTime now) {
    const auto standing = standing_threads(pulses, now);
    if (standing.size() > told_) {
      for (const auto& thread : standing) spdlog::warn("{}", thread.what);
    }
    if (standing.empty() && told_ > 0) spdlog::info("all threads move again");
    told_ = standing.size();
  }

 private:
  std::size_t told_ = 0;
};

void reload(const Configuration& configuration, LivePublisher& publisher) {
  const auto read = reload_configuration(configuration);
  if (!read) {
    spdlog::error("reload: {}; the running configuration stays", read.error().text());
    return;
  }
  publisher.reconfigure(read->tunables);
  spdlog::info("reload: [lcm] and [noise] of {} are in force", configuration.file.string());
  for (const auto& name : read->at_next_start)
    spdlog::warn("reload: [{}] has changed, too; that takes effect at the next start", name);
}

/// Through which this PC may ask how the run is. A door that cannot be opened is told, and is no reason not
/// to record.
struct Doors {
  Doors(const MetricsOptions& metrics, const StatusBoard& board) {
    if (auto opened = StatusSocket::open(board)) {
      status = std::move(*opened);
    } else {
      spdlog::info("`imuscope status` cannot ask this run: {}", opened.error().text());
    }
    if (metrics.port == 0) return;
    if (auto opened = MetricsServer::open(metrics.address, metrics.port, board)) {
      numbers = std::move(*opened);
      spdlog::info("metrics are offered at {} port {}", metrics.address, metrics.port);
    } else {
      spdlog::error("{}", opened.error().text());
    }
  }

  std::unique_ptr<StatusSocket> status;
  std::unique_ptr<MetricsServer> numbers;
};

/// A recording is never written over, nor the files beside it.
Result<void> check_folder(const std::filesystem::path& out) {
  if (!std::filesystem::exists(out / "capture.lcm")) return {};
  return usage_error(fmt::format("{} already holds a recording", out.string()),
                     "choose another --out folder");
}

Result<void> check_lines(const Configuration& configuration) {
  for (const auto& device : configuration.devices) {
    if (has_line(device)) continue;
    return usage_error(
        fmt::format("{}: device '{}' has no transport, so it cannot be run live", configuration.file.string(),
                    device.name),
        "give it transport = { kind = \"serial\", port = ..., baud = ... }, or use imuscope process");
  }
  return {};
}

/// @param retain  remove old runs beside options.out, where [record] says so
Result<void> run_into(const Configuration& configuration, const LiveOptions& options, bool retain,
                      LiveSignals& signals) {
  const auto spec = noise::parse_model(configuration.noise.model);
  if (!spec) return tl::unexpected<Error>(spec.error());
  if (auto checked = check_folder(options.out); !checked) return checked;
  if (auto sized = set_thread_stack_size(kThreadStackBytes); !sized) spdlog::warn("{}", sized.error().text());

  set_journal_run(configuration.run_name, device_names(configuration));
  LiveHistory history;
  const EstimatorConfig estimator_settings = estimator_config(configuration);
  Core core(estimator_settings, configuration.devices.size(), {}, &history);
  std::vector<std::unique_ptr<DeviceDecoder>> decoders;
  std::vector<std::vector<CanId>> ids;
  for (std::size_t i = 0; i < configuration.devices.size(); ++i) {
    decoders.push_back(make_decoder(configuration.devices[i], static_cast<DeviceIndex>(i), ClockMapConfig{}));
    ids.push_back(decoders.back()->ids());
  }
  std::vector<std::size_t> line_owners;
  for (const auto& device : configuration.devices) line_owners.push_back(device.line_owner);
  IoThread io(core, std::move(decoders), line_owners, raw_ring_bytes(configuration.devices));
  const HostTime t0{((host_now() + kStartDelay).time_since_epoch() / kTickPeriod) * kTickPeriod};
  const RunHeader header = run_header(configuration, options, t0);
  core.set_pc_clock(t0, header.t0_wall);
  CoreThread estimator(core, t0);

  auto publisher = LivePublisher::create(configuration, *spec, options, io, estimator);
  if (!publisher) return tl::unexpected<Error>(publisher.error());
  if (auto opened = (*publisher)->smooth(history, estimator_settings); !opened) return opened;
  (*publisher)->watch_can(ids);
  std::unique_ptr<LiveBag> bag;
  if (configuration.record.mcap) {
    auto begun = LiveBag::start(configuration, (*publisher)->folder(), options.version);
    if (!begun) return tl::unexpected<Error>(begun.error());
    bag = std::move(*begun);
    (*publisher)->set_bag(*bag);
  }
  Recorder::Options recording{options.out / "capture.lcm", configuration.lcm.channel_prefix, header};
  recording.sync_interval = from_seconds(configuration.record.sync_s);
  recording.max_file_bytes = static_cast<std::uint64_t>(configuration.record.file_bytes);
  recording.max_file_age = from_seconds(configuration.record.file_s);
  if (bag) recording.raw_tap = [&bag](const RawChunk& chunk) { bag->on_chunk(chunk); };
  auto recorder = Recorder::start(std::move(recording), {&io.raw_ring()},
                                  {&io.exceptions(), &estimator.rings().exceptions});
  if (!recorder) return tl::unexpected<Error>(recorder.error());
  (*publisher)->set_recorder(**recorder);

  std::vector<Error> refusals;
  if (auto locked = lock_memory(); !locked) refusals.push_back(locked.error());
  if (auto started = io.start({kIoThreadName, Scheduling::kFifo, kIoPriority, configuration.threads.io_cores},
                              t0, refusals);
      !started)
    return started;
  estimator.start(
      {kEstimatorThreadName, Scheduling::kFifo, kEstimatorPriority, configuration.threads.estimator_cores},
      refusals);
  (*publisher)->start();
  log_refusals(refusals);
  (*publisher)->set_refusals(refusals);
  const RunLock lock(options.out);
  // Of a run whose folder somebody named, the folder of [record] is none of its business.
  std::optional<Retention> retention;
  if (retain) retention.emplace(options.parent, configuration.record);
  const Doors doors(configuration.metrics, (*publisher)->board());
  spdlog::info("running '{}' into {}; Ctrl-C ends it", configuration.run_name, options.out.string());
  SystemdNotify systemd;
  systemd.ready(fmt::format("recording into {}", options.out.string()));

  Supervisor supervisor(configuration, ids, io, **publisher);
  DeviceEvents devices;
  const auto pulses = (*publisher)->pulses();
  const ControllingTerminal terminal;
  StandingThreads standing;
  std::string told;
  const HostTime started = host_now();
  const auto over = [&] {
    return options.duration_s && host_now() - started > from_seconds(*options.duration_s);
  };
  while (!signals.stop.load(std::memory_order_relaxed) && !over()) {
    const HostTime now = host_now();
    supervisor.step(now);
    if (signals.hang_up.exchange(false, std::memory_order_relaxed)) {
      if (terminal.is_gone()) {
        spdlog::info("the terminal was closed");
        break;
      }
      systemd.reloading(now);
      reload(configuration, **publisher);
      systemd.ready(told);
    }
    const auto health = (*publisher)->health();
    if (auto text = health.state + ": " + health.reason; text != told) {
      if (!says_the_same(text, told)) spdlog::info("{}", text);
      systemd.status(text);
      told = std::move(text);
    }
    standing.look(pulses, now);
    if (all_alive(pulses, now)) systemd.alive(now);
    if (devices.wait(kSupervisorPeriod)) supervisor.try_at_once();
  }
  systemd.stopping();

  // In the order of the flow, so that nothing is lost: no more bytes, then their last tick, then what came of
  // it.
  spdlog::info("ending: estimating, recording and writing what has arrived");
  io.stop();
  const auto tail =
      io.newest_arrival() > HostTime::min() ? (io.newest_arrival() - t0) / kTickPeriod + kTailTicks : 0;
  estimator.finish(tail);
  auto written = (*publisher)->finish(estimator.last_tick());
  auto recorded = (*recorder)->stop();
  const bool came = io.newest_arrival() != HostTime::min();
  Result<void> documents;
  if (recorded && written && came) {
    const auto status = (*recorder)->status();
    spdlog::info("recorded {} ({:.1f} MB); study it with: imuscope process {} --out study",
                 status.path.string(), static_cast<double>(status.bytes) * 1e-6, status.path.string());
    if (options.add_documents) documents = options.add_documents(options.out);
  }
  auto bagged = bag ? bag->finish((*publisher)->folder()) : Result<void>{};
  if (!recorded) return recorded;
  if (!written) return written;
  if (!came) {
    return work_error("no device ever sent a sample",
                      "check power, cables and baud rates; the log above names each line");
  }
  if (!documents) return documents;
  return bagged;
}

}  // namespace

Result<std::filesystem::path> run_live(const Configuration& configuration, const LiveOptions& wanted,
                                       LiveSignals& signals) {
  if (auto checked = check_lines(configuration); !checked) return tl::unexpected<Error>(checked.error());
  LiveOptions options = wanted;
  if (options.out.empty()) {
    auto made = make_new_folder(options.parent, configuration.run_name, std::chrono::system_clock::now());
    if (!made) return tl::unexpected<Error>(made.error());
    options.out = std::move(*made);
  }
  if (auto done = run_into(configuration, options, wanted.out.empty(), signals); !done)
    return tl::unexpected<Error>(done.error());
  return options.out;
}

}  // namespace imuscope
