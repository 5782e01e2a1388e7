#include "capture_axes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <future>
#include <optional>
#include <string>
#include <utility>

#include "capture/capture_reader.h"
#include "sample_axes.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/byte_source.h"
#include "service/recording/decoded_reads.h"
#include "service/recording/recording.h"
#include "service/recording/side_by_side.h"

namespace imuscope::cli {
namespace {

/// Decodes one device of a capture from its first byte to its last, while another thread reads ahead.
Result<void> decode(const std::filesystem::path& capture, const Configuration& configuration,
                    std::size_t device, SampleSink& sink) {
  const auto& devices = configuration.devices;
  constexpr std::uint64_t kNobodyAsksHowFar = 0;
  auto source = open_captured_device(capture, devices[devices[device].line_owner].name, kNobodyAsksHowFar,
                                     reading_by_threads());
  if (!source) return tl::unexpected<Error>(source.error());
  // The stamps of a capture are of one clock.
  auto decoder = make_decoder(devices[device], static_cast<DeviceIndex>(device), {});
  DecodedReads reads(std::move(*source), std::move(decoder), false);
  for (;;) {
    const auto read = reads.next();
    if (!read) return tl::unexpected<Error>(read.error());
    if (!*read) return {};
    for (const Sample& sample : (*read)->samples) sink.on_sample(sample);
  }
}

bool is_imu(const DeviceConfig& device) {
  return device.role == DeviceRole::kReference || device.role == DeviceRole::kStudy;
}

SensorRecord record_of(const std::filesystem::path& file, const std::string& device, SampleAxes&& read) {
  SensorRecord sensor{fmt::format("{}, {}", file.stem().string(), device),
                      {file.filename().string()},
                      "device " + device,
                      {}};
  for (std::size_t i = 0; i < read.axes.size(); ++i) {
    Signal& signal = read.axes[i];
    // A triad that the device does not send is none of the record's.
    if (!read.is_sent[i]) continue;
    certificate::AxisRecord axis;
    axis.name = kMessageAxes[i];
    axis.unit = axis.name.starts_with("gyro") ? noise::SignalUnit::kRadps : noise::SignalUnit::kMps2;
    axis.rate_hz = *signal.rate_hz;
    axis.values = std::move(signal.values);
    axis.mask = std::move(signal.mask);
    axis.fetch = std::move(read.fetches[i]);
    axis.temperature_c = read.temperature_c;
    axis.read_with_temperature = std::move(read.read_with_temperature[i]);
    sensor.axes.push_back(std::move(axis));
  }
  return sensor;
}

bool is_wanted(const DeviceConfig& device, const RecordChoice& choice) {
  return is_imu(device) && (choice.imu.empty() || device.name == choice.imu);
}

/// An IMU whose samples were gathered.
struct Gathered {
  std::size_t device;
  AxesSink sink{AxesSink::Keeps::kLongOnesOnDisk};
  Result<void> done{};
};

/// The first IMU that is wanted, by the configuration that the capture begins with, as long as another thread sees
/// through the whole of it; nothing where that cannot be.
std::optional<Gathered> gather_ahead(const std::filesystem::path& file, const RecordChoice& choice) {
  const auto run = may_use_threads() ? run_header_of(file) : std::nullopt;
  if (!run) return std::nullopt;
  const auto configuration = parse_configuration(run->configuration, run->name);
  if (!configuration) return std::nullopt;
  const auto& devices = configuration->devices;
  const auto at =
      std::ranges::find_if(devices, [&](const DeviceConfig& device) { return is_wanted(device, choice); });
  if (at == devices.end()) return std::nullopt;
  Gathered ahead{static_cast<std::size_t>(at - devices.begin())};
  ahead.done = decode(file, *configuration, ahead.device, ahead.sink);
  return ahead;
}

}  // namespace

bool is_capture(const std::filesystem::path& file) { return file.extension() == ".lcm"; }

Result<std::vector<SensorRecord>> read_capture_axes(const std::filesystem::path& file,
                                                    const RecordChoice& choice) {
  auto seen = std::async(may_use_threads() ? std::launch::async : std::launch::deferred,
                         [&file] { return open_recording({file.string()}, std::nullopt); });
  auto ahead = gather_ahead(file, choice);
  const auto opened = seen.get();
  if (!opened) return tl::unexpected<Error>(opened.error());
  const auto& devices = opened->configuration.devices;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    if (is_imu(devices[i]) && opened->recording.present[i]) names.push_back(devices[i].name);
  }
  if (names.empty())
    return work_error(fmt::format("{} holds no IMU", file.string()), "give a capture of a run with one");
  if (!choice.imu.empty() && std::ranges::find(names, choice.imu) == names.end()) {
    return usage_error(fmt::format("{} holds no IMU {}", file.string(), choice.imu),
                       fmt::format("give --name; there is {}", fmt::join(names, ", ")));
  }
  std::vector<SensorRecord> records;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const std::string& name = devices[i].name;
    if (!is_wanted(devices[i], choice) || !opened->recording.present[i]) continue;
    Gathered gathered{i};
    if (ahead && ahead->device == i) {
      gathered = *std::exchange(ahead, std::nullopt);
    } else {
      gathered.done = decode(file, opened->configuration, i, gathered.sink);
    }
    if (!gathered.done) return tl::unexpected(gathered.done.error());
    if (gathered.sink.empty()) continue;
    auto read = std::move(gathered.sink).axes(choice.signal.rate_hz);
    if (!read) {
      Error error = read.error();
      error.what = fmt::format("{}, {}: {}", file.string(), name, error.what);
      return tl::unexpected<Error>(error);
    }
    records.push_back(record_of(file, name, std::move(*read)));
  }
  if (records.empty()) return work_error(fmt::format("{} holds no sample of an IMU", file.string()));
  records.front().warnings = opened->recording.damage;
  return records;
}

}  // namespace imuscope::cli
