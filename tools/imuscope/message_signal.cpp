#include "message_signal.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "service/pipeline/device_factory.h"
#include "service/recording/message_log.h"
#include "service/recording/message_source.h"

namespace imuscope::cli {
namespace {

/// Messages begin with the device's name. Here no device is configured: the name is the file's, and is told once.
std::string of_file(const std::string& text, const std::filesystem::path& file) {
  const std::string name = file.filename().string();
  if (!text.starts_with(name + ": ")) return text;
  const std::string rest = text.substr(name.size() + 2);
  return rest.find(name) != std::string::npos ? rest : fmt::format("{}: {}", file.string(), rest);
}

Result<AxesSink> samples_of(const std::filesystem::path& file, const std::string& topic,
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
    error.what = of_file(error.what, file);
    // There is no configuration here.
    if (const auto at = error.remedy.find("give topic in its [device.messages]"); at != std::string::npos)
      error.remedy.replace(at, std::string_view("give topic in its [device.messages]").size(),
                           "give --topic");
    return tl::unexpected<Error>(error);
  }
  for (const std::string& loss : survey->losses) warnings.push_back(of_file(loss, file));
  auto source = open_messages(file, device, *survey);
  if (!source) return tl::unexpected<Error>(source.error());
  const auto decoder = make_decoder(device, 0, ClockMapConfig::fixed(HostTime{}, 1.0));
  AxesSink sink;
  for (;;) {
    const auto read = (*source)->next();
    if (!read) return tl::unexpected<Error>(read.error());
    if (!*read) break;
    decoder->push((*read)->bytes, HostTime{}, sink);
  }
  decoder->finish(HostTime{}, sink);
  if (const auto problem = decoder_problem(device, *decoder); !problem.empty())
    warnings.push_back(fmt::format("{}: {}", file.string(), problem));
  return sink;
}

}  // namespace

bool is_message_log(const std::filesystem::path& file) {
  return file.extension() == ".mcap" || file.extension() == ".bag" || file.extension() == ".ulg" ||
         find_message_log(file);
}

Result<MessageAxes> read_message_axes(const std::filesystem::path& file, const std::string& topic,
                                      std::optional<double> rate_hz) {
  MessageAxes read;
  auto samples = samples_of(file, topic, read.warnings);
  if (!samples) return tl::unexpected<Error>(samples.error());
  auto axes = std::move(*samples).axes(rate_hz);
  if (!axes) {
    Error error = axes.error();
    error.what = fmt::format("{}: {}", file.string(), error.what);
    return tl::unexpected<Error>(error);
  }
  read.axes = std::move(axes->axes);
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
