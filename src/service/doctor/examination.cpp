#include "service/doctor/examination.h"

#include <algorithm>
#include <utility>

#include "rt/host_clock.h"
#include "service/doctor/checks.h"
#include "service/doors/status_socket.h"
#include "service/lines/line_factory.h"
#include "service/pipeline/device_factory.h"

namespace imuscope::doctor {

namespace {

/// Published messages of three S-IMUs, which the capture keeps, too.
constexpr double kMessagesBytes_per_s = 60e3;
constexpr double kRawRecordBytes = 75.0;  // LCM and raw_t around each read
constexpr double kReads_per_s = 100.0;    // one a sample
constexpr double kBitsPerByte = 10.0;     // 8N1
constexpr double kDefaultRaw_per_s = 60e3;

double recorded_bytes_per_s(const std::optional<Configuration>& configuration) {
  if (!configuration) return kDefaultRaw_per_s + kMessagesBytes_per_s;
  double bytes = kMessagesBytes_per_s;
  for (const auto& device : configuration->devices) {
    bytes += kReads_per_s * kRawRecordBytes;
    if (device.serial) bytes += device.serial->baud / kBitsPerByte;
  }
  return bytes;
}

void append(std::vector<Finding>& to, std::vector<Finding> findings) {
  for (auto& finding : findings) to.push_back(std::move(finding));
}

/// The status of a run of this very configuration that goes on.
std::optional<status_t> running(const Configuration& configuration) {
  const auto sockets = find_status_sockets();
  if (!sockets) return std::nullopt;
  for (const auto& socket : *sockets) {
    auto asked = ask_status(socket);
    if (asked && asked->status.configuration_hash == configuration.sha256) return std::move(asked->status);
  }
  return std::nullopt;
}

Finding look_at_line(const DeviceConfig& device, DeviceIndex index, const std::optional<status_t>& run) {
  if (run) {
    const auto found = std::find_if(run->devices.begin(), run->devices.end(),
                                    [&](const device_status_t& one) { return one.name == device.name; });
    if (found != run->devices.end()) return check_line_of_run(*found);
  }
  const auto line = open_line(device, make_decoder(device, index, ClockMapConfig{})->ids());
  return check_line(device.name, line ? Result<void>{} : Result<void>(tl::unexpected<Error>(line.error())));
}

}  // namespace

std::vector<Finding> examine(const Examination& examination) {
  const auto& configuration = examination.configuration;
  std::vector<Finding> findings{check_real_time(),
                                check_memory_lock(),
                                check_cores(),
                                check_clock_source(examination.root),
                                check_governor(examination.root),
                                check_lcm(configuration ? configuration->lcm.url : LcmOptions{}.url),
                                check_receive_buffer(examination.root),
                                check_udev(examination.root),
                                check_wall_clock(wall_clock_now())};
  append(findings, check_unit(examination.root));
  if (configuration) append(findings, check_metrics(configuration->metrics));
  std::vector<std::string> ports;
  std::vector<std::string> interfaces;
  if (configuration) {
    const auto run = running(*configuration);
    for (std::size_t i = 0; i < configuration->devices.size(); ++i) {
      const auto& device = configuration->devices[i];
      if (device.can) interfaces.push_back(device.can->interface);
      if (!has_line(device)) continue;
      findings.push_back(look_at_line(device, static_cast<DeviceIndex>(i), run));
      if (device.serial) ports.push_back(device.serial->port);
    }
  }
  append(findings, check_ftdi_latency(examination.root, ports));
  append(findings, check_can(examination.root, interfaces));
  const auto folder =
      configuration && !configuration->record.folder.empty() ? configuration->record.folder : "runs";
  findings.push_back(check_disk(measure_disk(folder), recorded_bytes_per_s(configuration)));
  return findings;
}

}  // namespace imuscope::doctor
