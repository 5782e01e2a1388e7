#include "service/intake/import.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <fstream>

#include "capture/capture_writer.h"
#include "capture/record_codec.h"
#include "publish/channel_name.h"
#include "service/intake/draft.h"
#include "service/intake/protocol_finder.h"
#include "service/pipeline/core.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/message_log.h"
#include "service/recording/recording.h"

namespace imuscope {
namespace {

/// From this much of a file's beginning its protocol is found.
constexpr std::size_t kLook = 1U << 20U;
/// A read without a sample in it is cut here: the file holds something else.
constexpr std::size_t kLongestRead = 1U << 20U;
constexpr std::size_t kFlushBytes = 1U << 20U;
constexpr std::uint64_t kRecordsPerProgress = 4096;

/// A read with its arrival, of one device.
struct StampedRead {
  HostTime arrival{};
  std::vector<std::uint8_t> bytes;
};

/// The reads of one device, in order.
class DeviceReads {
 public:
  /// @param first_sample  arrival of its first sample, for what stands before it
  DeviceReads(std::unique_ptr<ByteSource> source, std::unique_ptr<DeviceDecoder> decoder,
              HostTime first_sample)
      : source_(std::move(source)), decoder_(std::move(decoder)) {
    stamp_.arrival = first_sample;
  }

  /// The next read; nothing at the end.
  Result<std::optional<StampedRead>> next() {
    for (;;) {
      if (at_ == rest_.size()) {
        auto read = source_->next();
        if (!read) return tl::unexpected<Error>(read.error());
        if (!*read) return last();
        if (!(*read)->arrival && stamp_.arrival == HostTime::min()) return std::optional<StampedRead>{};
        if ((*read)->arrival) {
          return StampedRead{*(*read)->arrival, {(*read)->bytes.begin(), (*read)->bytes.end()}};
        }
        rest_ = (*read)->bytes;
        at_ = 0;
      }
      if (take_until_sample()) return give();
    }
  }
  [[nodiscard]] std::uint64_t bytes_read() const { return source_->bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const { return source_->bytes_total(); }

 private:
  class Stamp final : public SampleSink {
   public:
    void on_sample(const Sample& sample) noexcept override {
      arrival = std::max(arrival, sample.arrival);
      came = true;
    }
    HostTime arrival = HostTime::min();
    bool came = false;
  };

  /// Byte by byte, as the wire brings them: a read must end exactly where a sample is complete.
  bool take_until_sample() {
    while (at_ < rest_.size()) {
      decoder_->push(rest_.subspan(at_, 1), HostTime{}, stamp_);
      pending_.push_back(rest_[at_++]);
      if (std::exchange(stamp_.came, false)) return true;
      if (pending_.size() >= kLongestRead) return true;
    }
    return false;
  }
  StampedRead give() { return {stamp_.arrival, std::exchange(pending_, {})}; }
  std::optional<StampedRead> last() {
    if (pending_.empty()) return std::nullopt;
    return give();
  }

  std::unique_ptr<ByteSource> source_;
  std::unique_ptr<DeviceDecoder> decoder_;
  std::span<const std::uint8_t> rest_;
  std::size_t at_ = 0;
  std::vector<std::uint8_t> pending_;
  Stamp stamp_;
};

/// Arrival of a source's first read, or of its first sample where reads have no arrivals; HostTime::min()
/// where it has none.
Result<HostTime> first_arrival(ByteSource& source, DeviceDecoder& decoder) {
  class First final : public SampleSink {
   public:
    void on_sample(const Sample& sample) noexcept override {
      if (arrival == HostTime::min()) arrival = sample.arrival;
    }
    HostTime arrival = HostTime::min();
  } first;
  while (first.arrival == HostTime::min()) {
    auto read = source.next();
    if (!read) return tl::unexpected<Error>(read.error());
    if (!*read) {
      decoder.finish(HostTime{}, first);
      break;
    }
    if ((*read)->arrival) return *(*read)->arrival;
    decoder.push((*read)->bytes, HostTime{}, first);
  }
  return first.arrival;
}

Result<std::vector<std::uint8_t>> beginning_of(const std::string& file) {
  auto source = open_raw_dump(file);
  if (!source) return tl::unexpected<Error>(source.error());
  std::vector<std::uint8_t> bytes;
  while (bytes.size() < kLook) {
    const auto read = (*source)->next();
    if (!read) return tl::unexpected<Error>(read.error());
    if (!*read) break;
    bytes.insert(bytes.end(), (*read)->bytes.begin(), (*read)->bytes.end());
  }
  return bytes;
}

/// Whether a topic is a whole IMU that no better topic of the same log holds.
bool is_best_imu(const FoundTopic& topic, const std::vector<FoundTopic>& topics) {
  if (topic.type != "sensor_msgs/Imu") return false;
  const auto has = [&](std::string_view begin) {
    return std::any_of(topics.begin(), topics.end(),
                       [&](const auto& t) { return t.name.starts_with(begin); });
  };
  // Of PX4 and ArduPilot: gyros and accelerometers apart, and what is made of others.
  for (const std::string_view half : {"sensor_gyro/", "sensor_accel/", "ACC/", "GYR/", "ISB/"}) {
    if (topic.name.starts_with(half)) return false;
  }
  if (topic.name.starts_with("sensor_combined/")) return !has("vehicle_imu/");
  if (topic.name.starts_with("IMT/")) return !has("IMU/");
  return true;
}

/// A device's name of a topic's: "vehicle_imu/0" is vehicle_imu_0.
std::string device_name_of(const std::string& topic) {
  constexpr std::size_t kLongest = 32;
  std::string name;
  for (const char c : topic) {
    const bool is_plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    if (is_plain || !name.empty()) name += is_plain ? c : '_';
  }
  return name.size() > kLongest ? name.substr(name.size() - kLongest) : name;
}

/// The devices that a file of many topics holds: all IMUs, the first receiver and the first that tells UTC.
Result<std::vector<FoundDevice>> devices_of_log(const std::string& file, Protocol protocol) {
  const auto topics = find_topics(file, protocol);
  if (!topics) return tl::unexpected<Error>(topics.error());
  std::vector<FoundDevice> devices;
  const auto has = [&](SampleKind purpose) {
    return std::any_of(devices.begin(), devices.end(),
                       [&](const auto& device) { return device.purpose == purpose; });
  };
  for (const FoundTopic& topic : *topics) {
    FoundDevice device;
    if (is_best_imu(topic, *topics)) device.purpose = SampleKind::kImu;
    if (topic.type == "sensor_msgs/NavSatFix" && !has(SampleKind::kGnss)) device.purpose = SampleKind::kGnss;
    if (topic.type == "sensor_msgs/TimeReference" && !has(SampleKind::kPulse))
      device.purpose = SampleKind::kPulse;
    // Control characters and quotes have no place in a configuration.
    const bool is_text = std::all_of(topic.name.begin(), topic.name.end(),
                                     [](char c) { return c > ' ' && c != '"' && c != '\\' && c != '\x7F'; });
    if (!device.purpose || !is_text) continue;
    device.name = device_name_of(topic.name);
    device.protocol = protocol;
    if (topic.rate_hz > 0.0) device.rate_hz = topic.rate_hz;
    device.topic = topic.name;
    device.is_flu = protocol == Protocol::kMcap || protocol == Protocol::kRosbag;
    device.remark = fmt::format("{} messages", topic.messages);
    devices.push_back(std::move(device));
  }
  return devices;
}

/// A configuration from the files alone.
/// @param inputs  a file of many topics becomes NAME=FILE of each of its devices
Result<std::string> draft_from_files(std::vector<std::string>& inputs) {
  std::vector<FoundDevice> devices;
  for (const std::string& input : std::exchange(inputs, {})) {
    if (const auto log = find_message_log(input)) {
      const auto found = devices_of_log(input, *log);
      if (!found) return tl::unexpected<Error>(found.error());
      for (const auto& device : *found) inputs.push_back(device.name + "=" + input);
      devices.insert(devices.end(), found->begin(), found->end());
      continue;
    }
    inputs.push_back(input);
    const auto equals = input.find('=');
    if (equals == std::string::npos || equals == 0) {
      return usage_error(fmt::format("'{}' does not say whose recording it is", input),
                         "write NAME=FILE, such as mtx1=mtx1.bin");
    }
    FoundDevice device;
    device.name = input.substr(0, equals);
    const std::string file = input.substr(equals + 1);
    const auto bytes = beginning_of(file);
    if (!bytes) return tl::unexpected<Error>(bytes.error());
    const auto found = find_protocol(*bytes);
    if (!found) {
      return work_error(fmt::format("{}: no message of a known protocol in {}", device.name, file),
                        "say what it holds with --config");
    }
    device.protocol = found->protocol;
    device.rate_hz = found->rate_hz;
    device.remark = fmt::format("{}: {} messages at its beginning", file, found->messages);
    devices.push_back(std::move(device));
  }
  return draft_configuration("imported", devices);
}

Result<OpenedRecording> open_inputs(const ImportOptions& options) {
  const auto progress = [&options](const std::string& /*what*/, double share) {
    if (options.progress) options.progress(share);
  };
  if (options.configuration) return open_recording(options.inputs, options.configuration, progress);
  std::vector<std::string> inputs = options.inputs;
  const auto draft = draft_from_files(inputs);
  if (!draft) return tl::unexpected<Error>(draft.error());
  auto configuration = parse_configuration(*draft, "the draft");
  if (!configuration) return tl::unexpected<Error>(configuration.error());
  return open_dumps(inputs, std::move(*configuration), progress);
}

/// Writes the reads of all devices in the order of their arrival, equal ones in configuration order.
class Merger {
 public:
  Merger(const ImportOptions& options, const OpenedRecording& opened)
      : options_(options), opened_(opened), devices_(opened.configuration.devices.size()) {}

  Result<Imported> run() {
    if (auto begun = open_devices(); !begun) return tl::unexpected<Error>(begun.error());
    const Device* first = oldest();
    if (first == nullptr) return work_error("the files hold no read", "check that they are not empty");
    auto writer = CaptureWriter::create(options_.out);
    if (!writer) return tl::unexpected<Error>(writer.error());
    clock_.t0 = HostTime{(first->head->arrival.time_since_epoch() / kTickPeriod) * kTickPeriod};
    put_header(*writer);
    while (Device* device = oldest()) {
      put(*device, *writer);
      if (auto read = advance(*device); !read) return tl::unexpected<Error>(read.error());
      if (writer->pending_bytes() < kFlushBytes) continue;
      if (auto flushed = writer->flush(); !flushed) return tl::unexpected<Error>(flushed.error());
    }
    if (auto closed = writer->close(); !closed) return tl::unexpected<Error>(closed.error());
    return result();
  }

 private:
  struct Device {
    DeviceIndex index = 0;
    std::unique_ptr<DeviceReads> reads;
    std::optional<StampedRead> head;
    std::int64_t sequence = 0;
    Imported::Device counts;
  };

  Result<void> open_devices() {
    const Recording& recording = opened_.recording;
    for (std::size_t i = 0; i < devices_.size(); ++i) {
      if (!recording.present[i]) continue;
      const auto index = static_cast<DeviceIndex>(i);
      const DeviceConfig& config = opened_.configuration.devices[i];
      const ClockMapConfig& clock = recording.clocks[i].map;
      auto ahead = recording.open(index);
      if (!ahead) return tl::unexpected<Error>(ahead.error());
      const auto first = first_arrival(**ahead, *make_decoder(config, index, clock));
      if (!first) return tl::unexpected<Error>(first.error());
      auto source = recording.open(index);
      if (!source) return tl::unexpected<Error>(source.error());
      devices_[i].index = index;
      devices_[i].reads =
          std::make_unique<DeviceReads>(std::move(*source), make_decoder(config, index, clock), *first);
      devices_[i].counts = {config.name, 0, 0, recording.clocks[i].how};
      if (auto read = advance(devices_[i]); !read) return read;
    }
    return {};
  }

  Result<void> advance(Device& device) {
    auto read = device.reads->next();
    if (!read) return tl::unexpected<Error>(read.error());
    device.head = std::move(*read);
    if (options_.progress && ++reads_ % kRecordsPerProgress == 0) options_.progress(share());
    return {};
  }

  [[nodiscard]] Device* oldest() {
    Device* found = nullptr;
    for (Device& device : devices_) {
      if (!device.head) continue;
      if (found == nullptr || device.head->arrival < found->head->arrival) found = &device;
    }
    return found;
  }

  void put_header(CaptureWriter& writer) const {
    const Configuration& configuration = opened_.configuration;
    RunHeader header;
    header.name = configuration.run_name;
    header.version = options_.version;
    header.build = "imported";
    header.t0 = clock_.t0;
    header.period = kTickPeriod;
    header.t0_wall = clock_.t0_wall;
    header.configuration = configuration.text;
    header.configuration_hash = configuration.sha256;
    for (const auto& device : configuration.devices) header.devices.push_back(device.name);
    writer.append(channel_name(configuration.lcm.channel_prefix, "RUN"), clock_.utime(clock_.t0),
                  encode(header, 0));
  }

  void put(Device& device, CaptureWriter& writer) const {
    const Configuration& configuration = opened_.configuration;
    const std::string channel = channel_name(configuration.lcm.channel_prefix, "RAW", device.counts.name);
    std::span<const std::uint8_t> rest(device.head->bytes);
    ++device.counts.reads;
    device.counts.bytes += rest.size();
    while (!rest.empty()) {
      const auto piece = rest.first(std::min(rest.size(), kRawChunkBytes));
      rest = rest.subspan(piece.size());
      const RawChunk chunk{
          {device.sequence++, device.head->arrival, device.index, Direction::kRead, !rest.empty()}, piece};
      writer.append(channel, clock_.utime(chunk.info.arrival), encode(chunk, device.counts.name, clock_));
    }
  }

  [[nodiscard]] double share() const {
    double read = 0.0;
    double total = 1.0;
    for (const Device& device : devices_) {
      if (!device.reads) continue;
      read += static_cast<double>(device.reads->bytes_read());
      total += static_cast<double>(device.reads->bytes_total());
    }
    return read / total;
  }

  [[nodiscard]] Imported result() const {
    Imported imported;
    for (const Device& device : devices_) {
      if (device.reads) imported.devices.push_back(device.counts);
    }
    imported.remarks = opened_.remarks;
    return imported;
  }

  const ImportOptions& options_;
  const OpenedRecording& opened_;
  RecordClock clock_;
  std::vector<Device> devices_;
  std::uint64_t reads_ = 0;
};

}  // namespace

Result<Imported> import_recording(const ImportOptions& options) {
  const auto opened = open_inputs(options);
  if (!opened) return tl::unexpected<Error>(opened.error());
  auto imported = Merger(options, *opened).run();
  if (imported) imported->drafted = !options.configuration.has_value();
  return imported;
}

}  // namespace imuscope
