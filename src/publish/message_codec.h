#pragma once

/// LCM messages to bytes and back, without the library that transports them.

#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <span>
#include <vector>

namespace imuscope {

template <typename Message>
[[nodiscard]] std::vector<std::uint8_t> encode_message(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  // Cannot fail: the size is its own. LCM ends a string at a NUL within it, so that less may be written.
  const int written = message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(written));
  return bytes;
}

/// The message, if the bytes are one of this type and nothing more.
template <typename Message>
[[nodiscard]] std::optional<Message> decode_message(std::span<const std::uint8_t> bytes) {
  Message message{};
  try {
    const int size = static_cast<int>(bytes.size());
    if (message.decode(bytes.data(), 0, size) == size) return message;
  } catch (const std::exception&) {  // a damaged array length asks for more memory than there is
  }
  return std::nullopt;
}

}  // namespace imuscope
