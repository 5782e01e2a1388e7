#include <algorithm>
#include <limits>
#include <optional>

#include "capture/capture_reader.h"
#include "conversions.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/recording.h"
#include "stream_protocols.h"

namespace imuscope::python {
namespace {

namespace py = pybind11;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// Messages or reads that cross to Python together.
constexpr std::size_t kBatch = 1024;

py::dict device_counts(const CapturedDevice& device) {
  py::dict out;
  out["reads"] = device.reads;
  out["writes"] = device.writes;
  out["bytes_read"] = device.bytes_read;
  out["first_ns"] = to_ns(device.first);
  out["last_ns"] = to_ns(device.last);
  return out;
}

py::dict summarise(const std::string& file) {
  std::optional<CaptureSummary> summary;
  {
    const py::gil_scoped_release unlocked;
    summary = take(summarise_capture(file));
  }
  py::dict out;
  out["is_a_run"] = summary->has_run;
  out["name"] = summary->run.name;
  out["version"] = summary->run.version;
  out["t0_ns"] = to_ns(summary->run.t0);
  out["t0_wall_ns"] = to_ns(summary->run.t0_wall);
  out["configuration"] = summary->run.configuration;
  py::dict devices;
  for (const auto& [name, device] : summary->devices) devices[py::str(name)] = device_counts(device);
  out["devices"] = devices;
  py::list events;
  for (const auto& event : summary->events) events.append(py::make_tuple(to_ns(event.time), event.text));
  out["events"] = events;
  out["other_messages"] = summary->other_messages;
  const LogHealth health = health_of(summary->files);
  out["files"] = summary->files.size();
  out["bytes_skipped"] = health.bytes_skipped;
  return out;
}

/// The messages of a capture in the order of the file, as they stand there.
class CapturedMessages {
 public:
  explicit CapturedMessages(const std::string& file) : files_(take(CaptureFiles::open(file))) {}

  /// [(channel, utime, bytes)], none at the end.
  py::list next() {
    std::vector<LogEvent> events;
    {
      const py::gil_scoped_release unlocked;
      LogEvent event;
      while (events.size() < kBatch && files_.next(event)) events.push_back(std::move(event));
    }
    py::list out;
    for (const LogEvent& event : events)
      out.append(
          py::make_tuple(event.channel, event.utime,
                         py::bytes(reinterpret_cast<const char*>(event.data.data()), event.data.size())));
    return out;
  }

 private:
  CaptureFiles files_;
};

/// Reads and writes of a device, in the order of arrival.
class CapturedReads {
 public:
  CapturedReads(const std::string& file, const std::string& device)
      : reader_(take(CaptureReader::open(file, device))) {}

  /// [(device, arrival_ns, was read, bytes)], none at the end.
  py::list next() {
    std::vector<RawRead> reads;
    {
      const py::gil_scoped_release unlocked;
      while (reads.size() < kBatch) {
        auto read = reader_.next();
        if (!read) break;
        reads.push_back(std::move(*read));
      }
    }
    py::list out;
    for (const RawRead& read : reads)
      out.append(
          py::make_tuple(read.device, to_ns(read.arrival), read.direction == Direction::kRead,
                         py::bytes(reinterpret_cast<const char*>(read.bytes.data()), read.bytes.size())));
    return out;
  }

 private:
  CaptureReader reader_;
};

/// What every sample has, and columns of one kind of sample.
struct Columns {
  std::vector<std::int64_t> time_ns;
  std::vector<std::int64_t> arrival_ns;
  std::vector<std::int64_t> utc_ns;
  std::map<std::string, std::vector<double>> numbers;
  std::map<std::string, std::vector<double>> vectors;
  std::map<std::string, std::vector<std::int64_t>> counts;

  void add(const Sample& sample) {
    time_ns.push_back(to_ns(sample.time));
    arrival_ns.push_back(to_ns(sample.arrival));
    utc_ns.push_back(sample.has_utc ? to_ns(sample.utc) : std::numeric_limits<std::int64_t>::min());
  }
  void add_vector(const char* name, const Vector3& v, bool is_valid) {
    auto& column = vectors[name];
    for (const double value : v) column.push_back(is_valid ? value : kNaN);
  }
  void add_number(const char* name, double value, bool is_valid = true) {
    numbers[name].push_back(is_valid ? value : kNaN);
  }
};

class Gatherer final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override {
    switch (sample.kind) {
      case SampleKind::kImu:
        return add_imu(kinds["imu"], sample);
      case SampleKind::kGnss:
        return add_gnss(kinds["gnss"], sample);
      case SampleKind::kAttitude:
        return add_attitude(kinds["attitude"], sample);
      case SampleKind::kOdometry:
        kinds["odometry"].add(sample);
        kinds["odometry"].add_number("speed_mps", sample.odometry.speed_mps);
        return;
      case SampleKind::kPulse:
        kinds["pulse"].add(sample);
        kinds["pulse"].counts["wall_ns"].push_back(sample.pulse.wall_ns);
        return;
      case SampleKind::kSteering:
        kinds["steering"].add(sample);
        kinds["steering"].counts["unsteered_ns"].push_back(sample.steering.unsteered_ns);
        kinds["steering"].add_number("rate", sample.steering.rate);
        return;
    }
  }
  std::map<std::string, Columns> kinds;

 private:
  static void add_imu(Columns& out, const Sample& sample) {
    const ImuData& imu = sample.imu;
    out.add(sample);
    out.add_vector("omega_radps", imu.omega_radps, (imu.flags & kGyroValid) != 0);
    out.add_vector("f_mps2", imu.f_mps2, (imu.flags & kAccelValid) != 0);
    out.add_number("temperature_degC", imu.temperature_degC, (imu.flags & kHasTemperature) != 0);
    out.counts["counter"].push_back(imu.counter);
    out.counts["flags"].push_back(imu.flags);
  }
  static void add_gnss(Columns& out, const Sample& sample) {
    const GnssData& gnss = sample.gnss;
    const bool has_position = (gnss.flags & kPositionValid) != 0;
    out.add(sample);
    out.add_number("latitude_rad", gnss.latitude_rad, has_position);
    out.add_number("longitude_rad", gnss.longitude_rad, has_position);
    out.add_number("height_m", gnss.height_m, has_position);
    out.add_vector("v_n_mps", gnss.v_n_mps, (gnss.flags & kVelocityValid) != 0);
    out.add_vector("sd_position_m", gnss.sd_position_m, (gnss.flags & kHasPositionSd) != 0);
    out.add_vector("sd_velocity_mps", gnss.sd_velocity_mps, (gnss.flags & kHasVelocitySd) != 0);
    out.counts["solution"].push_back(static_cast<std::int64_t>(gnss.solution));
  }
  static void add_attitude(Columns& out, const Sample& sample) {
    const AttitudeData& attitude = sample.attitude;
    out.add(sample);
    out.add_number("roll_rad", attitude.roll_rad, (attitude.flags & kRollPitchValid) != 0);
    out.add_number("pitch_rad", attitude.pitch_rad, (attitude.flags & kRollPitchValid) != 0);
    out.add_number("heading_rad", attitude.heading_rad, (attitude.flags & kHeadingValid) != 0);
    out.add_vector("sd_rpy_rad", attitude.sd_rpy_rad, (attitude.flags & kHasAttitudeSd) != 0);
  }
};

void decode(const OpenedRecording& opened, std::size_t device, SampleSink& sink) {
  const auto index = static_cast<DeviceIndex>(device);
  const auto source = take(opened.recording.open(index));
  const auto decoder =
      make_decoder(opened.configuration.devices[device], index, opened.recording.clocks[device].map);
  for (;;) {
    const auto read = take(source->next());
    if (!read) break;
    if (read->per_byte) decoder->set_per_byte(*read->per_byte);
    const HostTime arrival = read->arrival.value_or(HostTime{});
    decoder->push(read->bytes, {arrival, read->received.value_or(arrival)}, sink);
  }
  decoder->finish(HostTime{}, sink);
}

std::size_t device_named(const Configuration& configuration, const std::string& name) {
  std::string names;
  for (std::size_t i = 0; i < configuration.devices.size(); ++i) {
    if (configuration.devices[i].name == name) return i;
    names += (names.empty() ? "" : ", ") + configuration.devices[i].name;
  }
  throw Failure({ErrorKind::kUsage, "there is no device " + name, "there are " + names});
}

py::dict dict_of(Columns&& columns) {
  constexpr std::size_t kAxes = 3;
  py::dict out;
  out["time_ns"] = array_of(std::move(columns.time_ns));
  out["arrival_ns"] = array_of(std::move(columns.arrival_ns));
  out["utc_ns"] = array_of(std::move(columns.utc_ns));
  for (auto& [name, values] : columns.numbers) out[py::str(name)] = array_of(std::move(values));
  for (auto& [name, values] : columns.vectors) out[py::str(name)] = array_of(std::move(values), kAxes);
  for (auto& [name, values] : columns.counts) out[py::str(name)] = array_of(std::move(values));
  return out;
}

/// {"imu": {column: array}, ...} of one device of a capture, or of raw dumps NAME=FILE.
py::dict samples(const std::vector<std::string>& inputs, const std::optional<std::string>& configuration,
                 const std::string& device) {
  Gatherer gathered;
  {
    const py::gil_scoped_release unlocked;
    std::optional<std::filesystem::path> path;
    if (configuration) path = *configuration;
    const auto opened = take(open_recording(inputs, path));
    const std::size_t index = device_named(opened.configuration, device);
    if (!opened.recording.present[index])
      throw Failure({ErrorKind::kWork, "the recording holds nothing of " + device, "choose another device"});
    decode(opened, index, gathered);
  }
  py::dict out;
  for (auto& [kind, columns] : gathered.kinds) out[py::str(kind)] = dict_of(std::move(columns));
  return out;
}

/// [(arrival_ns, name, JSON of its fields)] of every message in what a device sent, as its protocol's
/// documents call them. arrival_ns is that of the read in which the message began.
py::list protocol_messages(const std::string& file, const std::string& device) {
  struct Message {
    std::int64_t arrival_ns;
    std::string name;
    std::string fields;
  };
  std::vector<Message> messages;
  {
    const py::gil_scoped_release unlocked;
    const auto summary = take(summarise_capture(file));
    const auto configuration = take(parse_configuration(summary.run.configuration, file));
    const DeviceConfig& config = configuration.devices[device_named(configuration, device)];
    const auto protocols = cli::stream_protocols();
    const auto protocol = std::find_if(protocols.begin(), protocols.end(),
                                       [&](const auto& one) { return one.name == name_of(config.protocol); });
    if (protocol == protocols.end()) {
      throw Failure({ErrorKind::kUsage,
                     device + " speaks " + std::string(name_of(config.protocol)) +
                         ", whose messages are not a stream of bytes",
                     "take its samples"});
    }
    const std::string& carrier = configuration.devices[config.line_owner].name;
    auto reader = take(CaptureReader::open(file, carrier));
    std::vector<std::uint8_t> stream;
    std::vector<std::pair<std::uint64_t, std::int64_t>> arrivals;
    while (const auto read = reader.next()) {
      if (read->direction != Direction::kRead || read->device != carrier) continue;
      arrivals.emplace_back(stream.size(), to_ns(read->arrival));
      stream.insert(stream.end(), read->bytes.begin(), read->bytes.end());
    }
    cli::Visitor visitor;
    visitor.message = [&](const cli::DecodedMessage& message) {
      const auto behind =
          std::upper_bound(arrivals.begin(), arrivals.end(), message.offset,
                           [](std::uint64_t offset, const auto& one) { return offset < one.first; });
      messages.push_back({behind == arrivals.begin() ? 0 : std::prev(behind)->second, message.message,
                          message.fields.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)});
    };
    protocol->decode(stream, visitor);
  }
  py::list out;
  for (const Message& message : messages)
    out.append(py::make_tuple(message.arrival_ns, message.name, message.fields));
  return out;
}

}  // namespace

void bind_captures(py::module_& module) {
  module.def("summarise", &summarise);
  module.def("samples", &samples);
  module.def("protocol_messages", &protocol_messages);
  py::class_<CapturedMessages>(module, "CapturedMessages")
      .def(py::init<const std::string&>())
      .def("next", &CapturedMessages::next);
  py::class_<CapturedReads>(module, "CapturedReads")
      .def(py::init<const std::string&, const std::string&>())
      .def("next", &CapturedReads::next);
}

}  // namespace imuscope::python
