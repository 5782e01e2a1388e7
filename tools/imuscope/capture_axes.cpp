#include "capture_axes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>

#include "sample_axes.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/byte_source.h"
#include "service/recording/recording.h"
#include "service/recording/side_by_side.h"

namespace imuscope::cli {
namespace {

/// Decodes one device of a capture from its first byte to its last, while another thread reads ahead.
Result<void> decode(const std::filesystem::path& capture, const OpenedRecording& opened, std::size_t device,
                    SampleSink& sink) {
  const auto index = static_cast<DeviceIndex>(device);
  const auto& devices = opened.configuration.devices;
  constexpr std::uint64_t kNobodyAsksHowFar = 0;
  auto source = open_captured_device(capture, devices[devices[device].line_owner].name, kNobodyAsksHowFar,
                                     reading_by_threads());
  if (!source) return tl::unexpected<Error>(source.error());
  const auto decoder = make_decoder(devices[device], index, opened.recording.clocks[device].map);
  while (true) {
    const auto read = (*source)->next();
    if (!read) return tl::unexpected<Error>(read.error());
    if (!*read) break;
    decoder->push((*read)->bytes, (*read)->arrival.value_or(HostTime{}), sink);
  }
  decoder->finish(HostTime{}, sink);
  return {};
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
    axis.fetch_temperature = read.fetch_temperature;
    sensor.axes.push_back(std::move(axis));
  }
  return sensor;
}

}  // namespace

bool is_capture(const std::filesystem::path& file) { return file.extension() == ".lcm"; }

Result<std::vector<SensorRecord>> read_capture_axes(const std::filesystem::path& file,
                                                    const RecordChoice& choice) {
  const auto opened = open_recording({file.string()}, std::nullopt);
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
    if (!is_imu(devices[i]) || !opened->recording.present[i]) continue;
    if (!choice.imu.empty() && name != choice.imu) continue;
    AxesSink sink(AxesSink::Keeps::kLongOnesOnDisk);
    if (auto decoded = decode(file, *opened, i, sink); !decoded) return tl::unexpected(decoded.error());
    if (sink.empty()) continue;
    auto read = std::move(sink).axes(choice.signal.rate_hz);
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
