#include "service/lines/line_factory.h"

#include <fmt/format.h>

#include "drivers/transport/can_socket.h"
#include "drivers/transport/net_stream.h"
#include "drivers/transport/pps_source.h"
#include "drivers/transport/serial_port.h"

namespace imuscope {

bool has_line(const DeviceConfig& device) {
  return device.serial.has_value() || device.net.has_value() || device.can.has_value() ||
         device.pps.has_value();
}

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
  if (device.net) {
    const auto kind = device.net->udp ? NetSettings::Kind::kUdp : NetSettings::Kind::kTcp;
    auto stream = NetStream::open({kind, device.net->host, device.net->port});
    if (!stream) return tl::unexpected<Error>(std::move(stream.error()));
    return std::unique_ptr<Transport>(std::move(*stream));
  }
  if (device.pps) {
    auto source =
        PpsSource::open({device.pps->port, device.pps->clear_edge ? PulseEdge::kClear : PulseEdge::kAssert});
    if (!source) return tl::unexpected<Error>(std::move(source.error()));
    return std::unique_ptr<Transport>(std::move(*source));
  }
  return usage_error(fmt::format("device '{}' has no line", device.name), "give it a transport");
}

}  // namespace imuscope
