#pragma once

/// Fields of JSON files that may be absent or null (unknown): asked for, never assumed.

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace imuscope::tables {

/// The member `key`; null where absent or where `object` is no object.
const nlohmann::json& field(const nlohmann::json& object, const char* key);

std::optional<double> number_at(const nlohmann::json& object, const char* key);
/// Strings as they are, numbers and booleans as JSON writes them, else empty.
std::string text_at(const nlohmann::json& object, const char* key);

/// N numbers; empty where the member is no array of N numbers.
template <std::size_t N>
std::optional<std::array<double, N>> numbers_at(const nlohmann::json& object, const char* key) {
  const nlohmann::json& values = field(object, key);
  if (!values.is_array() || values.size() != N) return {};
  std::array<double, N> numbers{};
  for (std::size_t i = 0; i < N; ++i) {
    if (!values[i].is_number()) return {};
    numbers[i] = values[i].get<double>();
  }
  return numbers;
}

/// The entry of the array `list` whose "name" is `name`; null where there is none.
const nlohmann::json& named(const nlohmann::json& list, const std::string& name);

}  // namespace imuscope::tables
