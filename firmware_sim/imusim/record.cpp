#include "firmware_sim/imusim/record.h"

#include <fmt/format.h>
#include <atomic>
#include <chrono>
#include <cmath>
#include <fstream>
#include <future>
#include <limits>
#include <map>

#include "firmware_sim/devices/can_encoder.h"
#include "firmware_sim/imusim/capture_file.h"
#include "firmware_sim/imusim/fault_log.h"
#include "firmware_sim/imusim/output_file.h"
#include "firmware_sim/imusim/truth_files.h"

namespace imusim {
namespace {

/// How a recording's copy of the configuration begins: by it a recording of imusim's own is known.
constexpr std::string_view kRecordedBy = "# Recorded by imusim record";

/// Every file that a recording of this configuration may have.
std::vector<std::string> files_of(const Configuration& configuration) {
  std::vector<std::string> names{"capture.lcm", "config.toml", "truth.json",
                                 "truth.csv",   "faults.toml", "fault_log.json"};
  for (const PlayedDevice& device : configuration.devices) {
    for (const char* ending : {".bin", ".arrivals.csv", ".log"}) names.push_back(device.name + ending);
    names.push_back(fmt::format("errors_truth_{}.csv", device.name));
    if (!device.dbc.empty()) names.push_back(device.dbc);
  }
  return names;
}

bool holds_own_recording(const std::filesystem::path& folder) {
  std::ifstream copy(folder / "config.toml");
  std::string line;
  std::getline(copy, line);
  return line.rfind(kRecordedBy, 0) == 0;
}

/// The simulator's DBC file goes into the recording's folder, so its name may lead to no other.
Outcome<void> check_dbc_names(const Configuration& configuration) {
  for (const PlayedDevice& device : configuration.devices) {
    if (std::filesystem::path(device.dbc).filename() == device.dbc && device.dbc != "." && device.dbc != "..")
      continue;
    return wrong_usage(fmt::format(
        "{}: device '{}': imusim writes the DBC file of its frames beside the recording, and not to "
        "{}; give dbc a name without a folder",
        configuration.file.string(), device.name, device.dbc));
  }
  return {};
}

/// An earlier recording of imusim's own goes; a file of anybody else's that has such a name is not touched.
Outcome<void> clear_folder(const std::filesystem::path& folder, const Configuration& configuration) {
  const bool is_own = holds_own_recording(folder);
  for (const std::string& name : files_of(configuration)) {
    const std::filesystem::path file = folder / name;
    if (!std::filesystem::exists(std::filesystem::symlink_status(file))) continue;
    if (!is_own)
      return failed_work(fmt::format("{} holds {}, which imusim did not record; choose another --out",
                                     folder.string(), name));
    std::error_code error;
    if (!std::filesystem::remove(file, error))
      return failed_work(fmt::format("cannot replace {}: {}", file.string(), error.message()));
  }
  return {};
}

/// Runs one device through the whole scenario and writes what the host reads.
template <typename Line>
Outcome<Recorded> record_over(Line line, World& world, WorldDevice& device,
                              const std::filesystem::path& folder, std::atomic<double>& done_s) {
  OutputFile bytes_file(folder / (device.played.name + ".bin"));
  OutputFile arrivals(folder / (device.played.name + ".arrivals.csv"));
  arrivals.write("byte_offset,n_bytes,arrival_ns\n");
  Recorded recorded{device.played.name, 0, 0};
  const auto on_read = [&](std::span<const std::uint8_t> bytes, std::int64_t arrival_ns) {
    bytes_file.write(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const fmt::format_int offset(recorded.bytes);
    const fmt::format_int count(bytes.size());
    const fmt::format_int arrival(arrival_ns);
    arrivals.write(offset.data(), offset.size());
    arrivals.write(",", 1);
    arrivals.write(count.data(), count.size());
    arrivals.write(",", 1);
    arrivals.write(arrival.data(), arrival.size());
    arrivals.write("\n", 1);
    recorded.bytes += bytes.size();
    ++recorded.reads;
  };

  const double duration_s = world.motion().duration_s();
  constexpr double kStep_s = 1.0;
  const auto steps = static_cast<int>(std::ceil(duration_s / kStep_s));
  std::vector<Emission> emissions;
  for (int step = 1; step <= steps; ++step) {
    const double until_s = std::min(step * kStep_s, duration_s);
    emissions.clear();
    device.device->run_until(until_s, emissions);
    for (const Emission& emission : emissions) line.send(emission);
    line.deliver_until(until_s, on_read);
    done_s.fetch_add(kStep_s, std::memory_order_relaxed);
  }
  line.deliver_until(std::numeric_limits<double>::infinity(), on_read);
  if (auto closed = bytes_file.close(); !closed) return tl::unexpected(closed.error());
  if (auto closed = arrivals.close(); !closed) return tl::unexpected(closed.error());
  return recorded;
}

Outcome<Recorded> record_device(World& world, WorldDevice& device, const std::filesystem::path& folder,
                                std::atomic<double>& done_s) {
  if (device.played.gives_pulses())
    return record_over(world.pulse_line_of(device.played), world, device, folder, done_s);
  return record_over(world.line_of(device.played), world, device, folder, done_s);
}

/// The host's wall clock agrees with the scenario's at its beginning and then runs as the PC's clocks do: a
/// log of candump is stamped with it.
std::string candump_line(const CanFrame& frame, const std::string& interface, Utc stamp) {
  const auto us = std::chrono::round<std::chrono::microseconds>(stamp.time_since_epoch()).count();
  constexpr std::int64_t kUsPerSecond = 1'000'000;
  std::string line =
      fmt::format("({:010}.{:06}) {} {:03X}#", us / kUsPerSecond, us % kUsPerSecond, interface, frame.id);
  for (const std::uint8_t byte : frame.data) line += fmt::format("{:02X}", byte);
  return line + "\n";
}

/// The same for a device on a CAN bus: a log of candump, NAME.log.
Outcome<Recorded> record_can_device(World& world, WorldDevice& device, const std::filesystem::path& folder,
                                    std::atomic<double>& done_s) {
  OutputFile log(folder / (device.played.name + ".log"));
  Recorded recorded{device.played.name, 0, 0};
  const std::string interface = device.played.can_interface.empty() ? "can0" : device.played.can_interface;
  const auto on_frame = [&](const CanFrame& frame, double t_s) {
    const double wall_s = world.pc_clock().seconds_at(t_s);
    const std::string line = candump_line(
        frame, interface, utc_without_leap_second(gps_after(world.configuration().utc_begin, wall_s)));
    log.write(line);
    recorded.bytes += line.size();
    ++recorded.reads;
  };
  CanLine line = world.can_line_of(device.played);
  const double duration_s = world.motion().duration_s();
  constexpr double kStep_s = 1.0;
  std::vector<Emission> emissions;
  for (double until_s = kStep_s; until_s < duration_s + kStep_s; until_s += kStep_s) {
    emissions.clear();
    device.device->run_until(std::min(until_s, duration_s), emissions);
    for (const Emission& emission : emissions) line.send(emission);
    line.deliver_until(std::min(until_s, duration_s), on_frame);
    done_s.fetch_add(kStep_s, std::memory_order_relaxed);
  }
  line.deliver_until(std::numeric_limits<double>::infinity(), on_frame);
  if (auto closed = log.close(); !closed) return tl::unexpected(closed.error());
  return recorded;
}

/// The DBC file that the configuration names lies beside its copy.
Outcome<void> copy_dbc(const Configuration& configuration, const std::filesystem::path& folder) {
  for (const PlayedDevice& device : configuration.devices) {
    if (device.protocol != Protocol::kCanOdometry || device.dbc.empty()) continue;
    if (auto written = write_file(folder / device.dbc, std::string(wheel_dbc())); !written) return written;
  }
  return {};
}

std::string configuration_copy(const Configuration& configuration) {
  std::string inputs;
  for (const PlayedDevice& device : configuration.devices) {
    if (device.shares_line()) continue;
    inputs += fmt::format(" {0}={0}.{1}", device.name, Configuration::is_on_can(device) ? "log" : "bin");
  }
  return fmt::format(
      "{} with seed {} over {} s. Read from this folder by\n"
      "#   imuscope process{} --config config.toml --out RESULT\n\n{}",
      kRecordedBy, configuration.scenario.seed, configuration.scenario.duration_s, inputs,
      configuration.text);
}

/// What the configuration names, as the service keeps it in a capture: nothing beside a capture is read.
std::string attached_files(const Configuration& configuration) {
  std::map<std::string, std::string> files;
  for (const PlayedDevice& device : configuration.devices) {
    if (device.protocol == Protocol::kCanOdometry && !device.dbc.empty()) files[device.dbc] = wheel_dbc();
  }
  if (files.empty()) return {};
  std::string table = "\n[attached]\n";
  for (const auto& [name, text] : files) table += fmt::format("\"{}\" = '''\n{}'''\n", name, text);
  return table;
}

CaptureHeader capture_header(const Configuration& configuration) {
  CaptureHeader header;
  header.run_name = configuration.run_name;
  header.version = "imusim";
  header.utc_begin = configuration.utc_begin;
  header.host_begin_ns = kHostBegin_ns;
  header.channel_prefix = configuration.channel_prefix;
  header.configuration = configuration_copy(configuration) + attached_files(configuration);
  for (const PlayedDevice& device : configuration.devices) {
    if (!device.shares_line()) header.devices.push_back(device.name);
  }
  return header;
}

}  // namespace

Outcome<std::vector<Recorded>> record(const Configuration& configuration, const RecordOptions& options) {
  if (auto checked = check_dbc_names(configuration); !checked) return tl::unexpected(checked.error());
  if (auto made = make_folder(options.folder); !made) return tl::unexpected(made.error());
  World world(configuration, World::Beginning::kStreaming);
  if (auto checked = check_faults(world); !checked) return tl::unexpected(checked.error());
  if (auto cleared = clear_folder(options.folder, configuration); !cleared)
    return tl::unexpected(cleared.error());
  // First of all: it marks the folder, should the rest be cut short.
  if (auto written = write_file(options.folder / "config.toml", configuration_copy(configuration)); !written)
    return tl::unexpected(written.error());
  if (!configuration.fault_text.empty()) {
    if (auto written = write_file(options.folder / "faults.toml", configuration.fault_text); !written)
      return tl::unexpected(written.error());
  }
  if (auto written = write_truth_json(world, options.folder); !written)
    return tl::unexpected(written.error());
  if (auto written = write_truth_csv(world, options.folder, options.truth_rows_hz); !written)
    return tl::unexpected(written.error());
  if (auto copied = copy_dbc(configuration, options.folder); !copied) return tl::unexpected(copied.error());

  std::vector<std::unique_ptr<OutputFile>> error_files;
  if (options.true_errors) {
    for (const SImuTruth& study : world.studies()) {
      error_files.push_back(
          std::make_unique<OutputFile>(options.folder / fmt::format("errors_truth_{}.csv", study.name)));
      error_files.back()->write(error_header());
      world.observe(study.name, [&world, file = error_files.back().get()](const TrueSample& sample) {
        file->write(error_row(world, sample));
      });
    }
  }

  // Devices know nothing of one another, so each has a thread of its own.
  std::atomic<double> done_s = 0.0;
  std::vector<std::future<Outcome<Recorded>>> work;
  for (WorldDevice& device : world.devices())
    work.push_back(std::async(std::launch::async, [&world, &device, &options, &done_s] {
      const bool on_can = Configuration::is_on_can(device.played);
      return (on_can ? record_can_device : record_device)(world, device, options.folder, done_s);
    }));
  const double all_s = world.motion().duration_s() * static_cast<double>(work.size());
  std::vector<Recorded> recorded;
  Outcome<std::vector<Recorded>> result = recorded;
  for (std::future<Outcome<Recorded>>& one : work) {
    constexpr std::chrono::milliseconds kProgressInterval(100);
    while (one.wait_for(kProgressInterval) != std::future_status::ready)
      if (options.on_progress) options.on_progress(std::min(1.0, done_s.load() / all_s));
    const Outcome<Recorded> outcome = one.get();
    if (outcome && result)
      result->push_back(*outcome);
    else if (!outcome)
      result = tl::unexpected(outcome.error());
  }
  for (const auto& file : error_files)
    if (auto closed = file->close(); !closed && result) result = tl::unexpected(closed.error());
  if (result && !configuration.faults.empty()) {
    if (auto logged = write_fault_log(configuration, options.folder); !logged)
      return tl::unexpected(logged.error());
  }
  if (result) {
    if (auto captured = write_capture(capture_header(configuration), options.folder); !captured)
      return tl::unexpected(captured.error());
  }
  if (options.on_progress) options.on_progress(1.0);
  return result;
}

}  // namespace imusim
