#pragma once

/// The protocols that `imuscope decode` knows. Each turns a whole recorded stream into messages for people; a
/// driver turns the same bytes into samples. A new protocol is one file here and one line in the table.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

namespace imuscope::cli {

/// One message of a stream.
struct DecodedMessage {
  std::uint64_t offset = 0;  ///< of its first byte
  std::size_t size = 0;      ///< bytes of its frame, its line end included
  std::string message;       ///< what the protocol's documents call it
  bool proven = true;        ///< by a checksum or a shape that chance does not make: it tells the protocol
  nlohmann::ordered_json fields = nlohmann::ordered_json::object();
};

/// Who goes through a stream.
struct Visitor {
  std::function<void(const DecodedMessage&)> message;
  /// Now and then: the bytes before this one have been looked at.
  std::function<void(std::uint64_t offset)> position = [](std::uint64_t) {};
};

/// Bytes between two calls of Visitor::position.
inline constexpr std::uint64_t kPositionStep = std::uint64_t{1} << 20U;

struct StreamProtocol {
  std::string_view name;
  /// Calls back for each message, in stream order.
  void (*decode)(std::span<const std::uint8_t> stream, const Visitor& visitor);
  /// Its frames are protected well enough to be looked for between those of another protocol.
  bool mixes_with_others;
};

/// In the order in which they are tried.
std::span<const StreamProtocol> stream_protocols();

void decode_candump_frames(std::span<const std::uint8_t> stream, const Visitor& visitor);
void decode_xsens_mt(std::span<const std::uint8_t> stream, const Visitor& visitor);
void decode_ixblue_stdbin(std::span<const std::uint8_t> stream, const Visitor& visitor);
void decode_greis(std::span<const std::uint8_t> stream, const Visitor& visitor);
void decode_nmea(std::span<const std::uint8_t> stream, const Visitor& visitor);
void decode_ubx(std::span<const std::uint8_t> stream, const Visitor& visitor);
void decode_rtklib_pos(std::span<const std::uint8_t> stream, const Visitor& visitor);

/// Lower-case hexadecimal digits.
std::string hex(std::span<const std::uint8_t> bytes);

}  // namespace imuscope::cli
