#include "service/line_factory.h"

#include <fmt/format.h>

#include "drivers/transport/can_socket.h"
#include "drivers/transport/serial_port.h"

namespace imuscope {

bool has_line(const DeviceConfig& device) { return device.serial.has_value() || device.can.has_value(); }

Result<std::unique_ptr<Transport>> open_line(const DeviceConfig& device, const std::vector<CanId>& ids) {
  if (device.serial) {
    auto port = SerialPort::open({device.serial->port, device.serial->baud, device.serial->stop_bits});
    if (!port) return tl::unexpected<Error>(std::move(port.error()));
    return std::make_unique<SerialPort>(std::move(*port));
  }
  if (device.can) {
    auto socket = CanSocket::open({device.can->interface, ids});
    if (!socket) return tl::unexpected<Error>(std::move(socket.error()));
    return std::unique_ptr<Transport>(std::move(*socket));
  }
  return usage_error(fmt::format("device '{}' has no line", device.name), "give it a transport");
}

}  // namespace imuscope
