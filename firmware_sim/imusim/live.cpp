#include "firmware_sim/imusim/live.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>

#include "firmware_sim/devices/gnss_encoders.h"
#include "firmware_sim/imusim/fault_log.h"
#include "firmware_sim/imusim/truth_files.h"
#include "firmware_sim/io/can_port.h"
#include "firmware_sim/io/pseudo_terminal.h"
#include "firmware_sim/io/pulse_file.h"
#include "firmware_sim/io/pulse_line.h"
#include "firmware_sim/io/tcp_server.h"
#include "firmware_sim/io/udp_sender.h"
#include "firmware_sim/random/random.h"

namespace imusim {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
// As a USB host controller would, the player looks after its ports once a millisecond.
constexpr std::int64_t kLiveTick_ns = 1'000'000;

/// What a program opens: a pseudo-terminal, a connection to a TCP server, or a port that datagrams come to.
tl::expected<std::unique_ptr<LineEnd>, std::string> open_end(const PlayedDevice& played, int baud) {
  const auto moved = [](auto&& opened) -> tl::expected<std::unique_ptr<LineEnd>, std::string> {
    using End = typename std::decay_t<decltype(opened)>::value_type;
    if (!opened) return tl::unexpected(opened.error());
    return std::make_unique<End>(std::move(*opened));
  };
  if (played.udp_port != 0) return moved(UdpSender::open(played.address, played.udp_port));
  if (played.tcp_port == 0) return moved(PseudoTerminal::open(played.port, baud));
  const Bytes greeting = played.protocol == Protocol::kRtklibPos ? rtklib_header() : Bytes{};
  return moved(TcpServer::open(played.address, played.tcp_port, greeting));
}

/// A receiver samples the last of ten bits right as long as the speeds differ by less.
bool same_speed(int a_baud, int b_baud) {
  constexpr double kTolerance = 0.03;
  if (a_baud == 0) return true;  // a line without speeds
  return std::abs(static_cast<double>(a_baud) / b_baud - 1.0) < kTolerance;
}

/// A device, the line it drives and the pseudo-terminal at the end of the line, which is gone while the
/// device is unplugged.
struct Port {
  WorldDevice* device;
  SerialLine line;
  std::vector<Fault> unplugged;  ///< faults of that kind
  std::unique_ptr<LineEnd> terminal;
  LiveCounts counts;

  void plug_in_or_out(double t_s) {
    const bool out = std::any_of(unplugged.begin(), unplugged.end(),
                                 [&](const Fault& fault) { return fault.acts_at(t_s); });
    if (out == (terminal == nullptr)) return;
    terminal.reset();
    if (out) return;
    if (auto again = open_end(device->played, device->device->baud())) terminal = std::move(*again);
  }

  void run_until(double t_s) {
    plug_in_or_out(t_s);
    const Bytes heard = terminal ? terminal->read() : Bytes{};
    counts.received_bytes += heard.size();
    // At another speed than its own a device hears nothing that makes sense, nor does the host.
    const bool understood = terminal && same_speed(terminal->baud(), device->device->baud());
    if (!heard.empty() && understood) device->device->receive(heard, t_s);
    emissions.clear();
    device->device->run_until(t_s, emissions);
    line.set_baud(device->device->baud());
    for (const Emission& emission : emissions) line.send(emission);
    line.deliver_until(t_s, [&](std::span<const std::uint8_t> bytes, std::int64_t /*arrival_ns*/) {
      if (!understood) bytes = garbled(bytes);
      const std::size_t dropped = terminal ? terminal->write(bytes) : bytes.size();
      counts.dropped_bytes += dropped;
      note_unheard(dropped, t_s);
      counts.sent_bytes += bytes.size() - dropped;
    });
  }

  /// Until the program has opened the port again after it was unplugged, what is lost is lost to that.
  void note_unheard(std::size_t bytes, double t_s) {
    const auto last = std::find_if(unplugged.rbegin(), unplugged.rend(),
                                   [&](const Fault& fault) { return t_s >= fault.begin_s; });
    if (last != unplugged.rend()) last->tally->bytes_hit += bytes;
  }

  /// What a receiver at another speed makes of bytes: as many others.
  std::span<const std::uint8_t> garbled(std::span<const std::uint8_t> bytes) {
    noise.resize(bytes.size());
    for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random.bits() & 0xFFU);
    return noise;
  }

  std::vector<Emission> emissions{};
  Bytes noise{};
  Random random{0, "another speed"};
};

std::int64_t monotonic_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kNsPerSecond + now.tv_nsec;
}

void sleep_until(std::int64_t time_ns) {
  const timespec until{time_ns / kNsPerSecond, time_ns % kNsPerSecond};
  // Interrupted by a signal, it returns early: the caller looks whether it is to stop.
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

/// A device on a CAN bus, and the interface that it sends on.
struct CanEnd {
  WorldDevice* device;
  CanLine line;
  CanPort port;
  LiveCounts counts;

  void run_until(double t_s) {
    emissions.clear();
    device->device->run_until(t_s, emissions);
    for (const Emission& emission : emissions) line.send(emission);
    line.deliver_until(t_s, [this](const CanFrame& frame, double /*t_s*/) {
      const bool sent = port.write(frame);
      (sent ? counts.sent_bytes : counts.dropped_bytes) += frame.data.size();
    });
  }

  std::vector<Emission> emissions{};
};

/// A receiver's pulses, and where the newest of them lies.
struct PulseEnd {
  WorldDevice* device;
  PulseLine line;
  PulseFile file;
  LiveCounts counts;

  void run_until(double t_s) {
    emissions.clear();
    device->device->run_until(t_s, emissions);
    for (const Emission& emission : emissions) line.send(emission);
    line.deliver_until(t_s, [this](std::span<const std::uint8_t> bytes, std::int64_t /*arrival_ns*/) {
      const std::size_t dropped = file.write(bytes);
      counts.dropped_bytes += dropped;
      counts.sent_bytes += bytes.size() - dropped;
    });
  }

  std::vector<Emission> emissions{};
};

/// @param host_begin_ns  CLOCK_MONOTONIC at the scenario's time 0
Outcome<std::vector<PulseEnd>> open_pulse_ends(World& world, const LiveOptions& options,
                                               std::int64_t host_begin_ns) {
  std::vector<PulseEnd> ends;
  for (WorldDevice& device : world.devices()) {
    const PlayedDevice& played = device.played;
    if (!played.gives_pulses()) continue;
    auto file = PulseFile::open(played.port);
    if (!file) return failed_work(fmt::format("device '{}': {}", played.name, file.error()));
    if (options.on_line) options.on_line(fmt::format("{:<10} {}", played.name, played.port));
    ends.push_back(
        {&device, world.live_pulse_line_of(played, host_begin_ns), std::move(*file), {played.name, 0, 0, 0}});
  }
  return ends;
}

Outcome<std::vector<CanEnd>> open_can_ends(World& world, const LiveOptions& options) {
  std::vector<CanEnd> ends;
  for (WorldDevice& device : world.devices()) {
    const PlayedDevice& played = device.played;
    if (!Configuration::is_on_can(played)) continue;
    if (played.can_interface.empty())
      return wrong_usage(
          fmt::format("{}: device '{}' has no CAN interface to play on; give transport = {{ kind = "
                      "\"can\", interface = \"...\" }}",
                      world.configuration().file.string(), played.name));
    auto port = CanPort::open(played.can_interface);
    if (!port) return failed_work(fmt::format("device '{}': {}", played.name, port.error()));
    if (options.on_line) options.on_line(fmt::format("{:<10} {}", played.name, played.can_interface));
    ends.push_back({&device, world.can_line_of(played), std::move(*port), {played.name, 0, 0, 0}});
  }
  return ends;
}

std::string describe(const PlayedDevice& played) {
  if (played.tcp_port != 0) return fmt::format("tcp {}:{}", played.address, played.tcp_port);
  if (played.udp_port != 0) return fmt::format("udp {}:{}", played.address, played.udp_port);
  return fmt::format("{}, {} baud", played.port, played.baud);
}

Outcome<std::vector<Port>> open_ports(World& world, const LiveOptions& options) {
  std::vector<Port> ports;
  ports.reserve(world.devices().size());
  for (WorldDevice& device : world.devices()) {
    const PlayedDevice& played = device.played;
    if (Configuration::is_on_can(played) || played.gives_pulses()) continue;
    if (played.port.empty() && !played.is_on_network())
      return wrong_usage(fmt::format(
          "{}: device '{}' has no port to play on; give transport = {{ kind = \"serial\", port = \"...\" }}",
          world.configuration().file.string(), played.name));
    auto terminal = open_end(played, played.baud);
    if (!terminal) return failed_work(fmt::format("device '{}': {}", played.name, terminal.error()));
    if (options.on_line) options.on_line(fmt::format("{:<10} {}", played.name, describe(played)));
    ports.push_back({&device, world.line_of(played), {}, std::move(*terminal), {played.name, 0, 0, 0}});
    for (const Fault& fault : world.configuration().faults_of(played.name)) {
      if (fault.kind == FaultKind::kUnplug) ports.back().unplugged.push_back(fault);
    }
  }
  return ports;
}

}  // namespace

Outcome<std::vector<LiveCounts>> play(const Configuration& configuration, const LiveOptions& options,
                                      const std::atomic<bool>& stop) {
  if (options.start_s >= configuration.scenario.duration_s)
    return wrong_usage(fmt::format("the scenario lasts {} s; a start at {} s lies behind its end",
                                   configuration.scenario.duration_s, options.start_s));
  World world(configuration, World::Beginning::kPoweredOn, options.start_s);
  if (auto checked = check_faults(world); !checked) return tl::unexpected(checked.error());
  if (options.folder) {
    if (auto made = make_folder(*options.folder); !made) return tl::unexpected(made.error());
    if (auto written = write_truth_json(world, *options.folder); !written)
      return tl::unexpected(written.error());
    if (auto written = write_truth_csv(world, *options.folder); !written)
      return tl::unexpected(written.error());
  }
  auto ports = open_ports(world, options);
  if (!ports) return tl::unexpected(ports.error());
  auto can_ends = open_can_ends(world, options);
  if (!can_ends) return tl::unexpected(can_ends.error());

  const double end_s =
      std::min(configuration.scenario.duration_s,
               options.start_s + options.seconds.value_or(configuration.scenario.duration_s));
  const std::int64_t begin_ns = monotonic_ns();
  auto pulse_ends = open_pulse_ends(
      world, options, begin_ns - std::llround(options.start_s * static_cast<double>(kNsPerSecond)));
  if (!pulse_ends) return tl::unexpected(pulse_ends.error());
  for (std::int64_t tick_ns = begin_ns; !stop.load(); tick_ns += kLiveTick_ns) {
    sleep_until(tick_ns);
    const double t_s = options.start_s + static_cast<double>(monotonic_ns() - begin_ns) / kNsPerSecond;
    if (t_s > end_s) break;
    for (Port& port : *ports) port.run_until(t_s);
    for (CanEnd& end : *can_ends) end.run_until(t_s);
    for (PulseEnd& end : *pulse_ends) end.run_until(t_s);
  }
  if (options.folder && !configuration.faults.empty()) {
    if (auto logged = write_fault_log(configuration, *options.folder); !logged)
      return tl::unexpected(logged.error());
  }
  std::vector<LiveCounts> counts;
  for (const Port& port : *ports) counts.push_back(port.counts);
  for (const CanEnd& end : *can_ends) counts.push_back(end.counts);
  for (const PulseEnd& end : *pulse_ends) counts.push_back(end.counts);
  return counts;
}

}  // namespace imusim
