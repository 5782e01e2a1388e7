#include "results/tables/json_fields.h"

#include "base/json_text.h"

namespace imuscope::tables {
namespace {

const nlohmann::json& nothing() {
  static const nlohmann::json null;
  return null;
}

}  // namespace

const nlohmann::json& field(const nlohmann::json& object, const char* key) {
  if (!object.is_object()) return nothing();
  const auto member = object.find(key);
  return member == object.end() ? nothing() : *member;
}

std::optional<double> number_at(const nlohmann::json& object, const char* key) {
  const nlohmann::json& value = field(object, key);
  if (!value.is_number()) return {};
  return value.get<double>();
}

std::string text_at(const nlohmann::json& object, const char* key) {
  const nlohmann::json& value = field(object, key);
  if (value.is_string()) return value.get<std::string>();
  return value.is_number() || value.is_boolean() ? json_text(value, kJsonOneLine) : std::string{};
}

const nlohmann::json& named(const nlohmann::json& list, const std::string& name) {
  if (!list.is_array()) return nothing();
  for (const nlohmann::json& entry : list) {
    if (text_at(entry, "name") == name) return entry;
  }
  return nothing();
}

}  // namespace imuscope::tables
