#include <fmt/format.h>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/output_folder.h"
#include "commands.h"
#include "drivers/transport/can_interface.h"
#include "drivers/transport/port_problems.h"
#include "print.h"
#include "service/intake/draft.h"
#include "service/intake/probe.h"

namespace imuscope::cli {
namespace {

struct ProbeCommand {
  std::vector<std::string> ports;
  std::string write;
  bool json = false;
};

nlohmann::ordered_json json_of(const ProbedPort& port) {
  nlohmann::ordered_json out = {{"port", port.port}};
  out["protocol"] = port.protocol ? nlohmann::ordered_json(name_of(*port.protocol)) : nullptr;
  out["baud"] = port.protocol ? nlohmann::ordered_json(port.baud) : nullptr;
  out["device_id"] = port.device_id.empty() ? nullptr : nlohmann::ordered_json(port.device_id);
  out["rate_hz"] = port.rate_hz ? nlohmann::ordered_json(*port.rate_hz) : nullptr;
  out["problem"] = port.problem.empty() ? nullptr : nlohmann::ordered_json(port.problem);
  return out;
}

void print(const std::vector<ProbedPort>& ports, const std::vector<CanInterface>& interfaces) {
  std::size_t width = 4;
  for (const auto& port : ports) width = std::max(width, port.port.size());
  say("{:<{}}  {:>7}  {:<14}  {:<9}  {}\n", "port", width, "baud", "protocol", "device", "rate");
  for (const auto& port : ports) {
    if (!port.protocol) {
      say("{:<{}}  {:>7}  {}\n", port.port, width, "-", port.problem);
      continue;
    }
    say("{:<{}}  {:>7}  {:<14}  {:<9}  {}\n", port.port, width, port.baud, name_of(*port.protocol),
        port.device_id.empty() ? "-" : port.device_id,
        port.rate_hz ? fmt::format("{:.1f} Hz", *port.rate_hz) : "silent");
  }
  for (const auto& interface : interfaces)
    say("{:<{}}  {:>7}  CAN interface, {}\n", interface.name, width, interface.bit_rate,
        interface.is_up ? "up" : "down");
}

Result<void> write_draft(const std::string& file, const std::vector<ProbedPort>& ports) {
  if (std::filesystem::exists(file))
    return usage_error(fmt::format("{} exists", file), "choose another name for the draft");
  std::vector<FoundDevice> devices;
  for (const auto& port : ports) {
    if (!port.protocol) continue;
    FoundDevice device;
    device.protocol = *port.protocol;
    device.rate_hz = port.rate_hz;
    device.serial = SerialConfig{port.port, port.baud, 1};
    if (!port.device_id.empty()) device.remark = fmt::format("Device id {}.", port.device_id);
    devices.push_back(std::move(device));
  }
  const auto draft = draft_configuration(std::filesystem::path(file).stem().string(), devices);
  if (!draft) return tl::unexpected<Error>(draft.error());
  const auto folder = OutputFolder::open(std::filesystem::path(file).parent_path());
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (auto written = folder->write_whole(std::filesystem::path(file).filename().string(), *draft); !written)
    return written;
  say_aside("imuscope: drafted {}; look through it, then: imuscope run {}\n", file, file);
  return {};
}

Result<void> probe(const ProbeCommand& options) {
  const auto names = options.ports.empty() ? serial_ports() : options.ports;
  std::vector<CanInterface> interfaces;
  for (const auto& name : can_interfaces()) {
    if (auto interface = look_at_can_interface(name)) interfaces.push_back(std::move(*interface));
  }
  if (names.empty() && interfaces.empty())
    return work_error("this PC has no USB serial port and no CAN interface",
                      "plug the devices in, or name ports: imuscope probe /dev/ttyS0");
  const auto ports = probe_ports(names);
  if (options.json) {
    nlohmann::ordered_json out = {{"ports", nlohmann::ordered_json::array()},
                                  {"can", nlohmann::ordered_json::array()}};
    for (const auto& port : ports) out["ports"].push_back(json_of(port));
    for (const auto& interface : interfaces)
      out["can"].push_back(
          {{"interface", interface.name}, {"up", interface.is_up}, {"bit_rate", interface.bit_rate}});
    say("{}\n", json_text(out, 1));
  } else {
    print(ports, interfaces);
  }
  if (!options.write.empty()) return write_draft(options.write, ports);
  return {};
}

}  // namespace

void add_probe(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "probe", "Serial ports: their baud rates, protocols and devices; drafts a configuration");
  auto options = std::make_shared<ProbeCommand>();
  command->add_option("PORT", options->ports, "ports to look at (default: all USB serial ports)");
  command->add_option("--write", options->write, "draft a configuration that runs with what was found")
      ->type_name("FILE.toml");
  command->add_flag("--json", options->json, "one JSON object");
  on_chosen(*command, chosen, [options] { return probe(*options); });
}

}  // namespace imuscope::cli
