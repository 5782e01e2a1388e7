#include "logs/bag/message_json.h"

#include <fmt/compile.h>
#include <fmt/format.h>
#include <imuscope/message_fields.h>
#include <cmath>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <vector>

#include "base/json_text.h"
#include "publish/message_codec.h"

namespace imuscope::bag {
namespace {

using nlohmann::json;

template <typename T>
constexpr bool kIsVector = false;
template <typename T>
constexpr bool kIsVector<std::vector<T>> = true;

/// Writes values one after the other: thousands a second, so no document is made.
class JsonWriter {
 public:
  explicit JsonWriter(std::string& out) : out_(out) {}
  template <typename T>
  void value(const T& v) {
    if constexpr (std::is_floating_point_v<T>) {
      if (std::isfinite(v))
        fmt::format_to(std::back_inserter(out_), FMT_COMPILE("{}"), v);
      else
        out_ += "null";
    } else if constexpr (std::is_integral_v<T>) {
      fmt::format_to(std::back_inserter(out_), FMT_COMPILE("{}"), static_cast<std::int64_t>(v));
    } else if constexpr (std::is_same_v<T, std::string>) {
      out_ += json_text(json(v), kJsonOneLine);
    } else if constexpr (std::is_array_v<T> || kIsVector<T>) {
      out_ += '[';
      bool first = true;
      for (const auto& element : v) {
        if (!std::exchange(first, false)) out_ += ',';
        value(element);
      }
      out_ += ']';
    } else {
      object(v);
    }
  }
  template <typename Message>
  void object(const Message& message) {
    out_ += '{';
    bool first = true;
    visit_fields(message, [&](const char* name, const auto& v, const char* /*sentence*/) {
      if (!std::exchange(first, false)) out_ += ',';
      fmt::format_to(std::back_inserter(out_), FMT_COMPILE("\"{}\":"), name);
      value(v);
    });
    out_ += '}';
  }

 private:
  std::string& out_;
};

template <typename T>
json schema_of();

template <typename Message>
json object_schema() {
  json properties = json::object();
  const Message message{};
  visit_fields(message, [&](const char* name, const auto& v, const char* sentence) {
    json field = schema_of<std::remove_cvref_t<decltype(v)>>();
    if (*sentence != '\0') field["description"] = sentence;
    properties[name] = std::move(field);
  });
  return {{"type", "object"}, {"properties", std::move(properties)}};
}

template <typename T>
json schema_of() {
  if constexpr (std::is_floating_point_v<T>) {
    // Nulls come where nothing is known; viewers want one type of a field.
    return {{"type", "number"}};
  } else if constexpr (std::is_integral_v<T>) {
    return {{"type", "integer"}};
  } else if constexpr (std::is_same_v<T, std::string>) {
    return {{"type", "string"}};
  } else if constexpr (std::is_array_v<T>) {
    return {{"type", "array"}, {"items", schema_of<std::remove_extent_t<T>>()}};
  } else if constexpr (kIsVector<T>) {
    return {{"type", "array"}, {"items", schema_of<typename T::value_type>()}};
  } else {
    return object_schema<T>();
  }
}

/// Calls `with` with a null pointer of every type that is published; true where one says so.
template <typename With>
bool any_type(With&& with) {
  return with(static_cast<calibration_t*>(nullptr)) || with(static_cast<navigation_t*>(nullptr)) ||
         with(static_cast<error_t*>(nullptr)) || with(static_cast<odometry_t*>(nullptr)) ||
         with(static_cast<status_t*>(nullptr)) || with(static_cast<noise_model_t*>(nullptr)) ||
         with(static_cast<wavelet_variance_t*>(nullptr)) || with(static_cast<dynamics_t*>(nullptr)) ||
         with(static_cast<pc_clock_t*>(nullptr)) || with(static_cast<event_t*>(nullptr)) ||
         with(static_cast<virtual_imu_t*>(nullptr));
}

}  // namespace

template <typename Message>
std::string json_of(const Message& message) {
  std::string out;
  JsonWriter(out).object(message);
  return out;
}
template std::string json_of(const calibration_t&);
template std::string json_of(const navigation_t&);
template std::string json_of(const error_t&);
template std::string json_of(const event_t&);

std::optional<MessageText> message_text(std::span<const std::uint8_t> message) {
  MessageText text;
  const bool found = any_type([&]<typename Message>(Message* type) {
    const auto decoded = decode_message<Message>(message);
    if (!decoded) return false;
    text = {name_of(type), json_of(*decoded)};
    return true;
  });
  if (!found) return std::nullopt;
  return text;
}

std::string schema_text(const std::string& type) {
  std::string text;
  any_type([&]<typename Message>(Message* null) {
    if (type != name_of(null)) return false;
    json schema = object_schema<Message>();
    schema["title"] = std::string("imuscope.") + name_of(null);
    schema["description"] = sentence_of(null);
    text = json_text(schema, kJsonOneLine);
    return true;
  });
  return text;
}

}  // namespace imuscope::bag
