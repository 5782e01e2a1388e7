#pragma once

/// Messages of the LCM types as JSON, with a JSON Schema made of the types' own comments. What is not known
/// (NaN) is null.

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace imuscope::bag {

/// A message of any of our types, told by its fingerprint.
struct MessageText {
  std::string type;  ///< "navigation_t"
  std::string json;
};
/// Nothing where the bytes are of no type of ours, or damaged.
[[nodiscard]] std::optional<MessageText> message_text(std::span<const std::uint8_t> message);

/// JSON Schema of one of our types; empty for another name.
[[nodiscard]] std::string schema_text(const std::string& type);

/// The same of a message at hand.
template <typename Message>
[[nodiscard]] std::string json_of(const Message& message);

}  // namespace imuscope::bag
