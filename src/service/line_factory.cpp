#include "service/line_factory.h"

#include <fmt/format.h>

#include "drivers/transport/serial_port.h"

namespace imuscope {

bool has_line(const DeviceConfig& device) { return device.serial.has_value(); }

Result<std::unique_ptr<Transport>> open_line(const DeviceConfig& device) {
  if (device.serial) {
    auto port = SerialPort::open({device.serial->port, device.serial->baud, device.serial->stop_bits});
    if (!port) return tl::unexpected<Error>(std::move(port.error()));
    return std::make_unique<SerialPort>(std::move(*port));
  }
  return usage_error(fmt::format("device '{}' has no line", device.name), "give it a transport");
}

}  // namespace imuscope
