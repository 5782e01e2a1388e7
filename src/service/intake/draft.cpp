#include "service/intake/draft.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "service/intake/protocol_finder.h"

namespace imuscope {
namespace {

/// What a device is there for.
SampleKind purpose_of(const FoundDevice& device) {
  return device.purpose.value_or(traits_of(device.protocol).purpose);
}

/// Where the reference stands in the list; -1 without an IMU.
std::ptrdiff_t reference_of(const std::vector<FoundDevice>& devices) {
  const auto first = [&](auto&& is) {
    const auto found = std::find_if(devices.begin(), devices.end(), is);
    return found == devices.end() ? -1 : found - devices.begin();
  };
  const auto stdbin = first([](const FoundDevice& d) { return d.protocol == Protocol::kIxblueStdbin; });
  return stdbin >= 0 ? stdbin : first([](const FoundDevice& d) { return purpose_of(d) == SampleKind::kImu; });
}

/// A rate as a person would set it: measured ones are off by what the short look adds.
double rounded_rate(double rate_hz) {
  constexpr double kStep_hz = 5.0;
  return rate_hz < kStep_hz ? std::max(1.0, std::round(rate_hz)) : kStep_hz * std::round(rate_hz / kStep_hz);
}

std::string table_of(const FoundDevice& device, const std::string& name, DeviceRole role) {
  std::string text = device.remark.empty() ? "" : fmt::format("# {}\n", device.remark);
  text += fmt::format("[[device]]\nname = \"{}\"\nrole = \"{}\"\nprotocol = \"{}\"\n", name, name_of(role),
                      name_of(device.protocol));
  if (device.rate_hz) text += fmt::format("rate_hz = {:.1f}\n", rounded_rate(*device.rate_hz));
  if (role == DeviceRole::kGnss) {
    text +=
        "# From the reference's origin to the antenna, forward-right-down: measure it.\n"
        "antenna_lever_arm_b_m = [0.0, 0.0, 0.0]\n";
  }
  if (device.is_flu && role != DeviceRole::kGnss && role != DeviceRole::kTime)
    text += "axes = \"+x -y -z\"  # forward-left-up, as ROS has its bodies\n";
  if (!device.topic.empty()) text += fmt::format("[device.messages]\ntopic = \"{}\"\n", device.topic);
  if (device.serial) {
    text += fmt::format("transport = {{ kind = \"serial\", port = \"{}\", baud = {}", device.serial->port,
                        device.serial->baud);
    if (device.serial->stop_bits != 1) text += fmt::format(", stop_bits = {}", device.serial->stop_bits);
    text += " }\n";
  }
  return text;
}

}  // namespace

Result<std::string> draft_configuration(const std::string& run_name,
                                        const std::vector<FoundDevice>& devices) {
  const std::ptrdiff_t reference = reference_of(devices);
  std::string text = fmt::format(
      "# Drafted from what was found. Check roles, axes and the antenna's place before you rely on it.\n\n"
      "[run]\nname = \"{}\"\n",
      run_name);
  int studies = 0;
  int receivers = 0;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const FoundDevice& device = devices[i];
    const bool is_gnss = purpose_of(device) == SampleKind::kGnss;
    const bool is_time = purpose_of(device) == SampleKind::kPulse;
    const bool is_reference = static_cast<std::ptrdiff_t>(i) == reference;
    const DeviceRole role = is_gnss        ? DeviceRole::kGnss
                            : is_time      ? DeviceRole::kTime
                            : is_reference ? DeviceRole::kReference
                                           : DeviceRole::kStudy;
    studies += role == DeviceRole::kStudy ? 1 : 0;
    receivers += is_gnss ? 1 : 0;
    const std::string by_role = is_gnss        ? "gnss"
                                : is_time      ? "time"
                                : is_reference ? std::string("reference")
                                               : fmt::format("study{}", studies);
    text += "\n" + table_of(device, device.name.empty() ? by_role : device.name, role);
  }
  if (reference < 0 || studies == 0) {
    return work_error(
        "no configuration can be drafted: a run needs two IMUs, a reference and one under study",
        "check the power and the cable of those that were not found");
  }
  if (receivers > 1) {
    return work_error(fmt::format("no configuration can be drafted: {} GNSS receivers were found", receivers),
                      "keep the better one");
  }
  return text;
}

}  // namespace imuscope
