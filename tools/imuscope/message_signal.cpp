#include "message_signal.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "service/device_factory.h"
#include "service/message_log.h"
#include "service/message_source.h"
#include "time_column.h"

namespace imuscope::cli {
namespace {

/// Holes longer than this, alone or together, are not filled sample by sample.
constexpr std::int64_t kHolesMost = 10'000'000;

class Samples final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override { samples.push_back(sample); }
  std::vector<Sample> samples;
};

Result<std::vector<Sample>> samples_of(const std::filesystem::path& file, const std::string& topic,
                                       std::vector<std::string>& warnings) {
  DeviceConfig device;
  device.name = file.filename().string();
  device.role = DeviceRole::kReference;
  device.protocol = find_message_log(file).value_or(Protocol::kMcap);
  device.rate_hz = traits_of(device.protocol).rate_hz;
  device.messages.topic = topic;
  const auto survey = survey_messages(file, device);
  if (!survey) {
    Error error = survey.error();
    // There is no configuration here.
    if (const auto at = error.remedy.find("give topic in its [device.messages]"); at != std::string::npos)
      error.remedy.replace(at, std::string_view("give topic in its [device.messages]").size(),
                           "give --topic");
    return tl::unexpected<Error>(error);
  }
  warnings.insert(warnings.end(), survey->losses.begin(), survey->losses.end());
  auto source = open_messages(file, device, *survey);
  if (!source) return tl::unexpected<Error>(source.error());
  const auto decoder = make_decoder(device, 0, ClockMapConfig::fixed(HostTime{}, 1.0));
  Samples sink;
  for (;;) {
    const auto read = (*source)->next();
    if (!read) return tl::unexpected<Error>(read.error());
    if (!*read) break;
    decoder->push((*read)->bytes, HostTime{}, sink);
  }
  decoder->finish(HostTime{}, sink);
  if (const auto problem = decoder_problem(device, *decoder); !problem.empty())
    warnings.push_back(fmt::format("{}: {}", file.string(), problem));
  return std::move(sink.samples);
}

double value_of(const Sample& sample, std::size_t axis) {
  constexpr std::size_t kTriad = 3;
  return axis < kTriad ? sample.imu.omega_radps[axis] : sample.imu.f_mps2[axis - kTriad];
}

}  // namespace

bool is_message_log(const std::filesystem::path& file) {
  return file.extension() == ".mcap" || file.extension() == ".bag" || file.extension() == ".ulg" ||
         find_message_log(file);
}

Result<MessageAxes> read_message_axes(const std::filesystem::path& file, const std::string& topic,
                                      std::optional<double> rate_hz) {
  MessageAxes read;
  const auto samples = samples_of(file, topic, read.warnings);
  if (!samples) return tl::unexpected<Error>(samples.error());
  std::vector<double> stamps_s;
  // From the first: seconds since 1970 have no microseconds to spare in a double.
  for (const Sample& sample : *samples) stamps_s.push_back(to_seconds(sample.time - samples->front().time));
  const auto rows = rows_of_stamps(stamps_s, {}, rate_hz);
  if (!rows) {
    Error error = rows.error();
    error.what = fmt::format("{}: {}", file.string(), error.what);
    return tl::unexpected<Error>(error);
  }
  std::int64_t holes = 0;
  for (const std::int64_t n : rows->missing_before) holes = std::min(holes + n, kHolesMost + 1);
  if (holes > kHolesMost) {
    return work_error(fmt::format("{}: the times leave out more than {} samples", file.string(), kHolesMost),
                      "cut the file where the long gaps are");
  }
  for (std::size_t axis = 0; axis < read.axes.size(); ++axis) {
    Signal& signal = read.axes[axis];
    signal.rate_hz = rows->rate_hz;
    const std::uint32_t needed = axis < 3 ? kGyroValid : kAccelValid;
    for (std::size_t i = 0; i < samples->size(); ++i) {
      const auto hole = static_cast<std::size_t>(rows->missing_before[i]);
      signal.values.insert(signal.values.end(), hole, 0.0);
      signal.mask.insert(signal.mask.end(), hole, 0);
      const bool is_there = ((*samples)[i].imu.flags & needed) != 0;
      signal.values.push_back(is_there ? value_of((*samples)[i], axis) : 0.0);
      signal.mask.push_back(is_there ? 1 : 0);
    }
  }
  return read;
}

Result<Signal> read_any_signal(const std::filesystem::path& file, const SignalChoice& choice,
                               std::vector<std::string>& warnings) {
  if (!is_message_log(file)) return read_signal(file, choice);
  if (!choice.where.empty() || !choice.counter.empty() || !choice.time.empty()) {
    return usage_error(fmt::format("{} has no columns", file.string()),
                       "leave out --where, --counter and --time");
  }
  const auto axis = std::find(kMessageAxes.begin(), kMessageAxes.end(), choice.column);
  if (axis == kMessageAxes.end()) {
    return usage_error(choice.column.empty()
                           ? fmt::format("{}: no axis is chosen", file.string())
                           : fmt::format("{} has no axis '{}'", file.string(), choice.column),
                       fmt::format("give --column; there is {}", fmt::join(kMessageAxes, ", ")));
  }
  auto read = read_message_axes(file, choice.topic, choice.rate_hz);
  if (!read) return tl::unexpected<Error>(read.error());
  warnings.insert(warnings.end(), read->warnings.begin(), read->warnings.end());
  return std::move(read->axes[static_cast<std::size_t>(axis - kMessageAxes.begin())]);
}

}  // namespace imuscope::cli
