#include "service/recording/recording.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <future>
#include <utility>

#include "base/nearest_word.h"
#include "base/text.h"
#include "capture/capture_reader.h"
#include "capture/raw_dump.h"
#include "configuration/toml_reader.h"
#include "drivers/transport/candump.h"
#include "service/pipeline/device_factory.h"
#include "service/pipeline/noise_feedback.h"
#include "service/recording/candump_source.h"
#include "service/recording/capture_damage.h"
#include "service/recording/message_source.h"
#include "service/recording/recorded_look.h"
#include "service/recording/sample_collector.h"
#include "service/recording/side_by_side.h"

namespace imuscope {

namespace {

constexpr std::uint64_t kReadsPerProgress = 1024;
/// 2000-01-01: a clock that shows less was never set.
constexpr UtcTime kNoClock = utc_time_from_ns(946'684'800'000'000'000);

using Sources = Result<std::vector<std::unique_ptr<ByteSource>>>;

/// Of a recording in several files, each by itself.
std::function<Sources(Reading)> one_by_one(const Recording& recording) {
  return [open = recording.open, present = recording.present](Reading) -> Sources {
    std::vector<std::unique_ptr<ByteSource>> sources(present.size());
    for (std::size_t i = 0; i < present.size(); ++i) {
      if (!present[i]) continue;
      auto source = open(static_cast<DeviceIndex>(i));
      if (!source) return tl::unexpected<Error>(source.error());
      sources[i] = std::move(*source);
    }
    return sources;
  };
}

/// @param clock  fixed for a source without arrivals
Result<std::vector<Sample>> decode_all(const DeviceConfig& device, DeviceIndex index,
                                       const std::vector<std::string>& inputs, const ClockMapConfig& clock,
                                       ByteSource& source, const OpeningProgress& progress) {
  std::vector<Sample> samples;
  SampleCollector collector(samples);
  const auto decoder = make_decoder(device, index, clock);
  for (std::uint64_t reads = 0;; ++reads) {
    auto read = source.next();
    if (!read) return tl::unexpected<Error>(read.error());
    if (!*read) break;
    if ((*read)->per_byte) decoder->set_per_byte(*(*read)->per_byte);
    decoder->push((*read)->bytes, (*read)->arrival.value_or(HostTime{}), collector);
    if (progress && reads % kReadsPerProgress == 0 && source.bytes_total() > 0) {
      progress("clock of " + device.name,
               static_cast<double>(source.bytes_read()) / static_cast<double>(source.bytes_total()));
    }
  }
  decoder->finish(HostTime{}, collector);
  if (samples.empty()) return tl::unexpected<Error>(no_sample_error(device, inputs, *decoder));
  return samples;
}

Result<std::vector<std::filesystem::path>> assign_files(const std::vector<std::string>& inputs,
                                                        const Configuration& configuration) {
  std::vector<std::string> names;
  for (const auto& device : configuration.devices) names.push_back(device.name);
  std::vector<std::filesystem::path> files(names.size());
  for (const auto& input : inputs) {
    const auto equals = input.find('=');
    const std::string name = input.substr(0, equals);
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) {
      const auto near = nearest_word(name, names);
      return usage_error(fmt::format("{}: the configuration has no device '{}'", input, name),
                         near.empty() ? fmt::format("its devices are {}", fmt::join(names, ", "))
                                      : fmt::format("did you mean '{}'?", near));
    }
    auto& file = files[static_cast<std::size_t>(found - names.begin())];
    if (!file.empty())
      return usage_error(fmt::format("device '{}' is given twice", name), "give one file a device");
    file = input.substr(equals + 1);
  }
  return files;
}

Result<void> check_roles(const Configuration& configuration, const std::vector<bool>& present) {
  const auto reference = configuration.reference_index();
  if (!present[reference]) {
    return usage_error(
        fmt::format("no file is given for the reference '{}'", configuration.devices[reference].name),
        fmt::format("add {}=FILE", configuration.devices[reference].name));
  }
  const auto studies = configuration.study_indices();
  if (std::none_of(studies.begin(), studies.end(), [&](std::size_t i) { return present[i]; })) {
    return usage_error("no file is given for any IMU under study",
                       fmt::format("add {}=FILE", configuration.devices[studies.front()].name));
  }
  return {};
}

/// Per device: what its log of candump holds, where it is given as one.
using Logs = std::vector<std::optional<CandumpSurvey>>;

/// Per device: what its file of many topics holds, where it is read from one.
using Bags = std::vector<std::optional<MessageSurvey>>;

/// The bytes of a device that is in no log of candump.
OpenSource open_plain(const Configuration& configuration, const std::vector<std::filesystem::path>& files,
                      Bags bags) {
  return [devices = configuration.devices, files, bags = std::move(bags)](DeviceIndex index) {
    return bags[index] ? open_messages(files[index], devices[index], *bags[index])
                       : open_raw_dump(files[index], RawDump::Arrivals::kChecked);
  };
}

/// Arrival stamps are times of the host, which nothing ties to a device's own.
Result<void> check_stamps(const std::vector<std::filesystem::path>& files, const std::vector<bool>& present,
                          const std::vector<bool>& unstamped, const Logs& logs, std::size_t reference) {
  const std::filesystem::path* with = nullptr;
  const std::filesystem::path* without = nullptr;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (present[i] && !logs[i]) (unstamped[i] ? without : with) = &files[i];
  }
  if (without != nullptr && logs[reference]) {
    return usage_error(fmt::format("the reference's frames in {} are stamped, and {} has no arrival stamps",
                                   files[reference].string(), without->string()),
                       fmt::format("put {} beside it", RawDump::arrivals_path(*without).filename().string()));
  }
  if (with == nullptr || without == nullptr) return {};
  return usage_error(fmt::format("{} has arrival stamps ({}) and {} has none", with->string(),
                                 RawDump::arrivals_path(*with).filename().string(), without->string()),
                     fmt::format("put {} beside it, or give only files without stamps",
                                 RawDump::arrivals_path(*without).filename().string()));
}

/// Brings the logs of candump to the time scale of the other devices. From then on they are stamped
/// recordings.
class LogAlignment {
 public:
  LogAlignment(const Configuration& configuration, const std::vector<std::string>& inputs,
               const std::vector<std::filesystem::path>& files, const Logs& logs,
               const OpeningProgress& progress, OpenedRecording& opened)
      : configuration_(configuration),
        inputs_(inputs),
        files_(files),
        logs_(logs),
        progress_(progress),
        opened_(opened),
        reference_(configuration.reference_index()),
        clocks_(files.size(), own_times()) {}

  Result<void> run() {
    if (std::none_of(logs_.begin(), logs_.end(), [](const auto& log) { return log.has_value(); })) return {};
    if (auto found = find_utc_of_run(); !found) return found;
    // The reference first: what cannot be brought to UTC is brought to it.
    if (logs_[reference_]) {
      if (auto aligned = align(reference_); !aligned) return aligned;
    }
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (!logs_[i] || i == reference_) continue;
      if (auto aligned = align(i); !aligned) return aligned;
    }
    opened_.recording.open = [files = files_, logs = logs_, clocks = clocks_,
                              plain = opened_.recording.open](DeviceIndex index) {
      return logs[index] ? open_candump(files[index], logs[index]->interface, clocks[index]) : plain(index);
    };
    return {};
  }

 private:
  static ClockMapConfig own_times() { return ClockMapConfig::fixed(HostTime{}, 1.0); }

  /// UTC tags of a recording that is no log: the reference's, or else a receiver's.
  Result<void> find_utc_of_run() {
    std::vector<std::size_t> candidates{reference_};
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (configuration_.devices[i].role == DeviceRole::kGnss) candidates.push_back(i);
    }
    for (const std::size_t i : candidates) {
      if (utc_of_run_ || logs_[i] || !opened_.recording.present[i]) continue;
      const auto samples = decode(i, own_times());
      if (!samples) return tl::unexpected<Error>(samples.error());
      utc_of_run_ = utc_minus_time(*samples);
    }
    return {};
  }

  [[nodiscard]] bool only_logs() const {
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (opened_.recording.present[i] && !logs_[i]) return false;
    }
    return true;
  }

  /// Logs of one PC's clock need no other to agree with one another.
  [[nodiscard]] bool has_the_runs_stamps(std::size_t i) const {
    if (!logs_[reference_] || !only_logs()) return false;
    return i == reference_ || files_[i] == files_[reference_] ||
           (logs_[i]->stamps_are_utc && logs_[reference_]->stamps_are_utc);
  }

  Result<void> align(std::size_t i) {
    const DeviceConfig& device = configuration_.devices[i];
    auto clock = align_log(
        device, {logs_[i]->stamps_are_utc, has_the_runs_stamps(i), utc_of_run_},
        [&] { return decode(reference_, clocks_[reference_]); }, [&] { return decode(i, own_times()); });
    if (!clock) return tl::unexpected<Error>(clock.error());
    opened_.remarks.push_back(fmt::format("{}: times from {}", device.name, clock->how));
    clocks_[i] = std::exchange(clock->map, ClockMapConfig{});
    opened_.recording.clocks[i] = std::move(*clock);
    return {};
  }

  /// @param log_clock  of a device in a log
  Result<std::vector<Sample>> decode(std::size_t i, const ClockMapConfig& log_clock) {
    const auto index = static_cast<DeviceIndex>(i);
    auto source =
        logs_[i] ? open_candump(files_[i], logs_[i]->interface, log_clock) : opened_.recording.open(index);
    if (!source) return tl::unexpected<Error>(source.error());
    return decode_all(configuration_.devices[i], index, inputs_, opened_.recording.clocks[i].map, **source,
                      progress_);
  }

  const Configuration& configuration_;
  const std::vector<std::string>& inputs_;
  const std::vector<std::filesystem::path>& files_;
  const Logs& logs_;
  const OpeningProgress& progress_;
  OpenedRecording& opened_;
  std::size_t reference_;
  std::vector<ClockMapConfig> clocks_;  ///< of logs: the run's time of their stamps
  std::optional<Duration> utc_of_run_;
};

/// Dumps as they are, before their clocks are brought together.
std::vector<check::Finding> look_at_dumps(const Configuration& configuration, Recording recording,
                                          const std::vector<bool>& unstamped) {
  std::vector<bool> has_own_clock(unstamped.size());
  recording.clocks.resize(unstamped.size());
  for (std::size_t i = 0; i < unstamped.size(); ++i) {
    if (!unstamped[i]) continue;
    recording.clocks[i].map = ClockMapConfig::fixed(HostTime{}, 1.0);
    has_own_clock[i] =
        i != configuration.reference_index() && !shares_the_reference_clock(configuration.devices[i]);
  }
  return look_at_recording(configuration, recording, has_own_clock);
}

Result<OpenedRecording> open_raw_dumps(const std::vector<std::string>& inputs, Configuration configuration,
                                       const OpeningProgress& progress,
                                       std::vector<check::Finding>* findings) {
  auto files = assign_files(inputs, configuration);
  if (!files) return tl::unexpected<Error>(files.error());
  const std::size_t n = configuration.devices.size();
  OpenedRecording opened;
  auto& recording = opened.recording;
  recording.inputs = inputs;
  recording.present.resize(n);
  std::vector<bool> unstamped(n);
  Logs logs(n);
  Bags bags(n);
  std::vector<std::future<Result<std::unique_ptr<ByteSource>>>> dumps(n);
  for (std::size_t i = 0; i < n; ++i) {
    auto& file = (*files)[i];
    if (file.empty()) file = (*files)[configuration.devices[i].line_owner];
    recording.present[i] = !file.empty();
    if (!recording.present[i]) {
      opened.remarks.push_back(
          fmt::format("{}: no file given; the run goes without it", configuration.devices[i].name));
      continue;
    }
    if (is_message_log(configuration.devices[i].protocol)) {
      auto survey = survey_messages(file, configuration.devices[i], progress);
      if (!survey) return tl::unexpected<Error>(survey.error());
      recording.damage.insert(recording.damage.end(), survey->losses.begin(), survey->losses.end());
      bags[i] = std::move(*survey);
      unstamped[i] = true;
      continue;
    }
    if (CandumpLog::looks_like_one((*files)[i])) {
      auto survey = survey_candump((*files)[i], configuration.devices[i], progress);
      if (!survey) return tl::unexpected<Error>(survey.error());
      opened.remarks.insert(opened.remarks.end(), survey->remarks.begin(), survey->remarks.end());
      logs[i] = std::move(*survey);
      continue;
    }
    // Opened here already, so that a wrong path is told before anything is computed.
    dumps[i] = std::async(may_use_threads() ? std::launch::async : std::launch::deferred,
                          [file] { return open_raw_dump(file); });
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!dumps[i].valid()) continue;
    auto source = dumps[i].get();
    if (!source) return tl::unexpected<Error>(source.error());
    const auto first = (*source)->next();
    if (!first) return tl::unexpected<Error>(first.error());
    unstamped[i] = *first && !(*first)->arrival;
  }
  if (auto checked = check_roles(configuration, recording.present); !checked) {
    return tl::unexpected<Error>(checked.error());
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!recording.present[i] || logs[i]) continue;
    if (auto valid = check_recorded_file(configuration.devices[i], (*files)[i]); !valid) {
      return tl::unexpected<Error>(valid.error());
    }
  }
  if (auto stamps = check_stamps(*files, recording.present, unstamped, logs, configuration.reference_index());
      !stamps) {
    return tl::unexpected<Error>(stamps.error());
  }
  opened.remarks.insert(opened.remarks.end(), recording.damage.begin(), recording.damage.end());
  recording.open = open_plain(configuration, *files, std::move(bags));
  recording.open_side_by_side = one_by_one(recording);
  recording.has_lines_apart = true;
  const bool has_log = std::any_of(logs.begin(), logs.end(), [](const auto& log) { return log.has_value(); });
  if (findings != nullptr && !has_log) *findings = look_at_dumps(configuration, recording, unstamped);
  auto clocks = align_clocks(configuration, unstamped, [&](DeviceIndex index) -> Result<std::vector<Sample>> {
    auto source = recording.open(index);
    if (!source) return tl::unexpected<Error>(source.error());
    return decode_all(configuration.devices[index], index, inputs, ClockMapConfig::fixed(HostTime{}, 1.0),
                      **source, progress);
  });
  if (!clocks) return tl::unexpected<Error>(clocks.error());
  recording.clocks = std::move(*clocks);
  if (auto aligned = LogAlignment(configuration, inputs, *files, logs, progress, opened).run(); !aligned) {
    return tl::unexpected<Error>(aligned.error());
  }
  recording.open_side_by_side = one_by_one(recording);
  if (findings != nullptr && has_log)
    *findings = look_at_recording(configuration, recording, std::vector<bool>(n));
  for (std::size_t i = 0; i < n; ++i) {
    if (!recording.present[i] || !unstamped[i]) continue;
    opened.remarks.push_back(fmt::format("{}: times from {}, {:+.3f} s", configuration.devices[i].name,
                                         recording.clocks[i].how, recording.clocks[i].shift_s));
  }
  opened.configuration = std::move(configuration);
  return opened;
}

RecordedSchedule schedule_of(const CaptureSummary& summary, const Configuration& configuration) {
  const auto index_of = [&](const std::string& name) {
    const auto* device = configuration.find(name);
    return static_cast<DeviceIndex>(device == nullptr ? 0 : device - configuration.devices.data());
  };
  RecordedSchedule schedule;
  schedule.t0 = summary.run.t0;
  for (const auto& stored : summary.exceptions) {
    const auto& exception = stored.exception;
    const DeviceIndex device = index_of(stored.device);
    switch (exception.kind) {
      case ExceptionKind::kLateSample:
        schedule.core.late_samples.push_back(
            {device, static_cast<std::uint64_t>(exception.sample_sequence), exception.tick});
        break;
      case ExceptionKind::kRefusedSample:
        schedule.refused_samples[device].add(exception.sample_sequence,
                                             std::max<std::int64_t>(exception.count, 1));
        break;
      case ExceptionKind::kSkippedTicks:
        schedule.skipped_ticks.add(exception.tick - exception.count, exception.count);
        break;
    }
  }
  const auto studies = configuration.study_indices();
  for (const auto& record : summary.applied_models) {
    const auto study = std::find(studies.begin(), studies.end(), index_of(record.device));
    if (study == studies.end()) continue;
    schedule.core.applied_noises.push_back(
        applied_noise_of(record, static_cast<std::size_t>(study - studies.begin())));
  }
  return schedule;
}

Result<OpenedRecording> open_capture(const std::string& input,
                                     const std::optional<std::filesystem::path>& file,
                                     const OpeningProgress& progress, std::vector<check::Finding>* findings) {
  const auto of_file = [&progress](double share) { progress("looking through", share); };
  const auto summary = progress ? summarise_capture(input, of_file) : summarise_capture(input);
  if (!summary) return tl::unexpected<Error>(summary.error());
  if (!summary->has_run && !file) {
    return usage_error(
        fmt::format("{} holds device bytes but not what was run", input),
        "add --config FILE.toml; where it is a part of a capture, give the capture's first file");
  }
  auto configuration = file ? load_configuration(*file)
                            : parse_configuration(summary->run.configuration,
                                                  fmt::format("{} (kept in the capture)", summary->run.name));
  if (!configuration) return tl::unexpected<Error>(configuration.error());
  const std::size_t n = configuration->devices.size();
  OpenedRecording opened;
  auto& recording = opened.recording;
  recording.inputs = {input};
  recording.present.resize(n);
  recording.clocks.resize(n);
  std::vector<std::uint64_t> bytes(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto& carrier = configuration->devices[configuration->devices[i].line_owner];
    const auto found = summary->devices.find(carrier.name);
    recording.present[i] = found != summary->devices.end() && found->second.reads > 0;
    if (recording.present[i]) {
      bytes[i] = found->second.bytes_read;
    } else {
      opened.remarks.push_back(
          fmt::format("{}: the capture holds nothing of it", configuration->devices[i].name));
    }
  }
  if (auto checked = check_roles(*configuration, recording.present); !checked) {
    return work_error(checked.error().what, "this capture cannot be studied with this configuration");
  }
  std::vector<std::string> names;
  for (const auto& device : configuration->devices) {
    names.push_back(configuration->devices[device.line_owner].name);
  }
  recording.open = [input, names, bytes](DeviceIndex index) {
    return open_captured_device(input, names[index], bytes[index]);
  };
  recording.open_side_by_side = [input, names, bytes,
                                 present = recording.present](Reading reading) -> Sources {
    std::vector<CapturedLine> lines;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (present[i]) lines.push_back({names[i], bytes[i]});
    }
    auto opened_lines = open_captured_lines(input, lines, reading);
    if (!opened_lines) return tl::unexpected<Error>(opened_lines.error());
    std::vector<std::unique_ptr<ByteSource>> sources(names.size());
    auto next = opened_lines->begin();
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (present[i]) sources[i] = std::move(*next++);
    }
    return sources;
  };
  // A log of reads that were imported may know nothing of UTC.
  if (summary->has_run && summary->run.t0_wall > kNoClock)
    recording.pc_clock = {summary->run.t0, summary->run.t0_wall};
  // Exceptions name devices by their index in the recorded configuration: they hold for that one alone.
  if (!summary->has_run) {
    opened.remarks.push_back(fmt::format(
        "{}: recorded by another program than imuscope run; ticks begin with its first bytes", input));
  } else if (configuration->sha256 == summary->run.configuration_hash) {
    recording.schedule = schedule_of(*summary, *configuration);
  } else {
    opened.remarks.emplace_back(
        "another configuration than the recorded one: results will differ from the live run's");
  }
  for (const auto& event : summary->events) recording.moments.push_back({event.time, event.text});
  recording.damage = damage_of(*summary, input);
  opened.remarks.insert(opened.remarks.end(), recording.damage.begin(), recording.damage.end());
  if (findings != nullptr) *findings = look_at_recording(*configuration, recording, std::vector<bool>(n));
  opened.configuration = std::move(*configuration);
  return opened;
}

}  // namespace

Result<OpenedRecording> open_dumps(const std::vector<std::string>& inputs, Configuration configuration,
                                   const OpeningProgress& progress) {
  return open_raw_dumps(inputs, std::move(configuration), progress, nullptr);
}

Result<OpenedRecording> open_recording(const std::vector<std::string>& inputs,
                                       const std::optional<std::filesystem::path>& configuration,
                                       const OpeningProgress& progress,
                                       std::vector<check::Finding>* findings) {
  const auto is_dump = [](const std::string& input) { return input.find('=') != std::string::npos; };
  const auto n_dumps = std::count_if(inputs.begin(), inputs.end(), is_dump);
  if (n_dumps == 0) {
    if (inputs.size() != 1) {
      return usage_error("more than one capture is given", "give one capture, or raw dumps as NAME=FILE");
    }
    return open_capture(inputs.front(), configuration, progress, findings);
  }
  if (static_cast<std::size_t>(n_dumps) != inputs.size()) {
    return usage_error("captures and raw dumps (NAME=FILE) are mixed", "give one capture, or raw dumps only");
  }
  if (!configuration) {
    return usage_error("raw dumps do not say what devices they come from", "add --config FILE.toml");
  }
  auto loaded = load_configuration(*configuration);
  if (!loaded) return tl::unexpected<Error>(loaded.error());
  return open_raw_dumps(inputs, std::move(*loaded), progress, findings);
}

}  // namespace imuscope
