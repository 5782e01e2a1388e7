#pragma once

/// One typical stream of every protocol, with the decoder for it: what the benchmark decodes and what tests
/// that hold for all decoders run over. Written from the protocols' layouts and not from the decoders.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/device/device.h"
#include "tests/drivers/support/streams.h"

namespace imuscope::test {

struct ProtocolStream {
  std::string name;
  Bytes bytes;
  Duration lasts{};         ///< on the wire, at the device's rate
  std::size_t samples = 0;  ///< that it holds
  std::function<std::unique_ptr<DeviceDecoder>()> make_decoder;
  /// The protocol's own checksum over all bytes, one byte after the other; empty where it has none.
  std::function<std::uint32_t(std::span<const std::uint8_t>)> checksum;
};

/// @param seconds  of data in each stream
std::vector<ProtocolStream> protocol_streams(int seconds);

/// Hands a stream to a decoder in reads of `read_size` bytes that arrive as the device sends them.
void push_in_reads(const ProtocolStream& stream, std::size_t read_size, DeviceDecoder& decoder,
                   SampleSink& sink);

}  // namespace imuscope::test
