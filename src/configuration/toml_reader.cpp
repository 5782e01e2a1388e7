#include "configuration/toml_reader.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>

#include "base/nearest_word.h"
#include "base/text.h"

namespace imuscope {

namespace {

std::string in_quotes(std::string_view text) { return fmt::format("\"{}\"", text); }

/// Six digits show every preset, and hide that degrees were kept as radians.
std::string short_number(double value) { return fmt::format("{:g}", value); }

std::string range(double low, double high) {
  return fmt::format("{} to {}", short_number(low), short_number(high));
}

}  // namespace

void TomlProblem::report(const toml::source_region& where, const std::string& what,
                         const std::string& remedy) {
  if (error) return;
  error = Error{ErrorKind::kUsage,
                where.begin.line > 0 ? fmt::format("{}:{}: {}", file, where.begin.line, what)
                                     : fmt::format("{}: {}", file, what),
                remedy};
}

TomlReader::TomlReader(const toml::table* table, std::string name, TomlProblem& problem)
    : table_(table), name_(std::move(name)), problem_(&problem) {}

bool TomlReader::has(std::string_view key) const { return table_ != nullptr && table_->contains(key); }

std::string TomlReader::full_name(std::string_view key) const {
  return name_.empty() ? std::string(key) : fmt::format("{}.{}", name_, key);
}

toml::source_region TomlReader::where(std::string_view key) const {
  if (has(key)) return table_->get(key)->source();
  return table_ != nullptr ? table_->source() : toml::source_region{};
}

const toml::node* TomlReader::find(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.emplace_back(key);
  return table_ != nullptr ? table_->get(key) : nullptr;
}

const toml::node* TomlReader::node(std::string_view key, const std::string& values,
                                   const std::string& preset) {
  if (problem_->asked != nullptr) problem_->asked->push_back({full_name(key), values, preset, false});
  return find(key);
}

void TomlReader::fail(std::string_view key, const std::string& what, const std::string& remedy) {
  problem_->report(where(key), fmt::format("{} {}", full_name(key), what), remedy);
}

void TomlReader::read_text(std::string_view key, std::string& value) {
  const auto* found = find(key);
  if (found == nullptr) return;
  if (const auto read = found->value_exact<std::string>()) {
    value = *read;
  } else {
    fail(key, "must be a text in quotes");
  }
}

/// The gate for text of a configuration, which a capture from elsewhere brings along.
const std::string& TomlReader::checked_text(std::string_view key, const std::string& text) {
  if (one_line(text) != text)
    fail(key, fmt::format("must be one line of at most {} bytes without control characters", kLineMax));
  return text;
}

void TomlReader::text(std::string_view key, std::string& value) {
  (void)node(key, "text", value.empty() ? "" : in_quotes(value));
  read_text(key, value);
  (void)checked_text(key, value);
}

void TomlReader::boolean(std::string_view key, bool& value) {
  const auto* found = node(key, "true or false", value ? "true" : "false");
  if (found == nullptr) return;
  if (const auto read = found->value_exact<bool>()) {
    value = *read;
  } else {
    fail(key, "must be true or false");
  }
}

bool TomlReader::read_number(std::string_view key, double& value, double unit, double low, double high) {
  const auto* found = find(key);
  if (found == nullptr) return false;
  const auto read = found->is_number() ? found->value<double>() : std::nullopt;
  if (!read || !(*read >= low && *read <= high)) {
    fail(key, fmt::format("must be a number from {} to {}", low, high));
    return false;
  }
  value = *read * unit;
  return true;
}

void TomlReader::number(std::string_view key, double& value, double unit, double low, double high) {
  (void)node(key, range(low, high), short_number(value / unit));
  read_number(key, value, unit, low, high);
}

void TomlReader::number(std::string_view key, std::optional<double>& value, double unit, double low,
                        double high) {
  (void)node(key, range(low, high), value ? short_number(*value / unit) : "");
  double read = 0.0;
  if (read_number(key, read, unit, low, high)) value = read;
}

void TomlReader::integer(std::string_view key, int& value, int low, int high) {
  (void)node(key, fmt::format("whole number, {} to {}", low, high), std::to_string(value));
  double read = value;
  read_number(key, read, 1.0, low, high);
  value = static_cast<int>(read);
  if (static_cast<double>(value) != read) fail(key, "must be a whole number");
}

void TomlReader::vector(std::string_view key, std::array<double, 3>& value, double unit) {
  const auto* found = node(key, "three numbers",
                           fmt::format("[{}, {}, {}]", short_number(value[0] / unit),
                                       short_number(value[1] / unit), short_number(value[2] / unit)));
  if (found == nullptr) return;
  const auto* list = found->as_array();
  if (list == nullptr || list->size() != 3 || !list->is_homogeneous() || !(*list)[0].is_number()) {
    fail(key, "must be three numbers, such as [0.0, 0.0, 0.0]", "write all three with a decimal point");
    return;
  }
  for (std::size_t i = 0; i < 3; ++i) value[i] = *(*list)[i].value<double>() * unit;
}

void TomlReader::texts(std::string_view key, std::array<std::string, 3>& value) {
  const auto* found =
      node(key, "three texts", value[0].empty() ? "" : fmt::format("[\"{}\"]", fmt::join(value, "\", \"")));
  if (found == nullptr) return;
  const auto* list = found->as_array();
  if (list == nullptr || list->size() != 3 || !list->is_homogeneous(toml::node_type::string)) {
    fail(key, "must be three texts in quotes");
    return;
  }
  for (std::size_t i = 0; i < 3; ++i) value[i] = checked_text(key, *(*list)[i].value<std::string>());
}

void TomlReader::texts(std::string_view key, std::vector<std::string>& value) {
  const auto* found = node(key, "list of texts");
  if (found == nullptr) return;
  const auto* list = found->as_array();
  if (list == nullptr || (!list->empty() && !list->is_homogeneous(toml::node_type::string))) {
    fail(key, "must be a list of texts in quotes");
    return;
  }
  value.clear();
  for (const auto& entry : *list) value.push_back(checked_text(key, *entry.value<std::string>()));
}

void TomlReader::numbers(std::string_view key, std::vector<double>& value) {
  const auto* found = node(key, "list of numbers");
  if (found == nullptr) return;
  const auto* list = found->as_array();
  value.clear();
  bool good = list != nullptr;
  for (std::size_t i = 0; good && i < list->size(); ++i) {
    good = (*list)[i].is_number();
    if (good) value.push_back(*(*list)[i].value<double>());
  }
  if (!good) fail(key, "must be a list of numbers");
}

void TomlReader::every_text(std::map<std::string, std::string>& values) {
  if (table_ == nullptr) return;
  for (const auto& [key, value] : *table_) {
    const std::string name(key.str());
    read_text(name, values[name]);
  }
}

std::size_t TomlReader::choice(std::string_view key, const std::vector<std::string_view>& words,
                               std::size_t fallback) {
  const auto* found =
      node(key, fmt::format("\"{}\"", fmt::join(words, "\", \"")), in_quotes(words[fallback]));
  std::string word;
  read_text(key, word);
  if (found == nullptr || problem_->error) return fallback;
  const auto named = std::find(words.begin(), words.end(), word);
  if (named != words.end()) return static_cast<std::size_t>(named - words.begin());
  fail(key, fmt::format("is '{}'", word), fmt::format("valid: {}", fmt::join(words, ", ")));
  return fallback;
}

TomlReader TomlReader::table(std::string_view key) {
  const auto* found = find(key);
  const auto* inner = found != nullptr ? found->as_table() : nullptr;
  if (found != nullptr && inner == nullptr) fail(key, "must be a table");
  return TomlReader(inner, full_name(key), *problem_);
}

const toml::array* TomlReader::array(std::string_view key) {
  const auto* found = find(key);
  const auto* list = found != nullptr ? found->as_array() : nullptr;
  if (found != nullptr && list == nullptr) fail(key, "must be a list");
  return list;
}

void TomlReader::require(std::string_view key, const std::string& purpose) {
  if (problem_->asked != nullptr) problem_->asked->push_back({full_name(key), {}, {}, true});
  if (!has(key)) problem_->report(where(key), fmt::format("{} is missing", full_name(key)), purpose);
}

void TomlReader::finish() {
  if (table_ == nullptr) return;
  for (const auto& [key, value] : *table_) {
    const std::string word(key.str());
    if (std::find(known_.begin(), known_.end(), word) != known_.end()) continue;
    const std::string near = nearest_word(word, known_);
    problem_->report(key.source(), fmt::format("unknown key '{}'", full_name(word)),
                     near.empty() ? fmt::format("valid here: {}", fmt::join(known_, ", "))
                                  : fmt::format("did you mean '{}'?", near));
  }
}

}  // namespace imuscope
