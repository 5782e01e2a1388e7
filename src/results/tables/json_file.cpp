#include "results/tables/json_file.h"

#include <fmt/format.h>
#include <string_view>

#include "base/text.h"

namespace imuscope::tables {

namespace {

using nlohmann::json;

/// Key of the text of a configuration in run.json.
constexpr const char* kConfigurationText = "configuration_text";

/// Whether brackets outside strings are nested deeper than kJsonDepthMax.
bool is_too_deep(std::string_view text) {
  std::size_t depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      in_string = c != '"';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kJsonDepthMax) return true;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return false;
}

/// The text of a configuration without what a terminal obeys; its lines stay.
std::string lines_of(std::string_view text) {
  std::string lines;
  while (!text.empty()) {
    const auto end = text.find('\n');
    lines += one_line(text.substr(0, end));
    if (end == std::string_view::npos) break;
    lines += '\n';
    text.remove_prefix(end + 1);
  }
  return lines;
}

void pass_gate(json& value) {
  if (value.is_string()) {
    value = one_line(value.get_ref<const std::string&>());
  } else if (value.is_array()) {
    for (json& element : value) pass_gate(element);
  } else if (value.is_object()) {
    json object = json::object();
    for (auto& [key, member] : value.get_ref<json::object_t&>()) {
      if (key == kConfigurationText && member.is_string()) {
        member = lines_of(member.get_ref<const std::string&>());
      } else {
        pass_gate(member);
      }
      object[one_line(key)] = std::move(member);
    }
    value = std::move(object);
  }
}

}  // namespace

json read_json_file(const std::filesystem::path& file) {
  const auto text = read_text_file(file, "JSON file", {});
  if (!text || is_too_deep(*text)) return json(json::value_t::discarded);
  json document = json::parse(*text, nullptr, /*allow_exceptions=*/false);
  pass_gate(document);
  return document;
}

Error malformed(const std::filesystem::path& run_folder, const nlohmann::json::exception& why) {
  // Before the words stands "[json.exception.out_of_range.403] ".
  std::string words = why.what();
  if (const auto end = words.find("] "); end != std::string::npos) words.erase(0, end + 2);
  return {
      ErrorKind::kWork,
      fmt::format("a JSON file of {}, or the truth.json given with it, is not as this version writes it: {}",
                  run_folder.string(), words),
      "make the run again"};
}

}  // namespace imuscope::tables
