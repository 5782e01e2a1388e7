#include "service/toml_reader.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>

#include "base/nearest_word.h"

namespace imuscope {

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

const toml::node* TomlReader::node(std::string_view key) {
  known_.emplace_back(key);
  return table_ != nullptr ? table_->get(key) : nullptr;
}

void TomlReader::fail(std::string_view key, const std::string& what, const std::string& remedy) {
  problem_->report(where(key), fmt::format("{} {}", full_name(key), what), remedy);
}

void TomlReader::text(std::string_view key, std::string& value) {
  const auto* found = node(key);
  if (found == nullptr) return;
  if (const auto read = found->value_exact<std::string>()) {
    value = *read;
  } else {
    fail(key, "must be a text in quotes");
  }
}

void TomlReader::boolean(std::string_view key, bool& value) {
  const auto* found = node(key);
  if (found == nullptr) return;
  if (const auto read = found->value_exact<bool>()) {
    value = *read;
  } else {
    fail(key, "must be true or false");
  }
}

void TomlReader::number(std::string_view key, double& value, double unit, double low, double high) {
  const auto* found = node(key);
  if (found == nullptr) return;
  const auto read = found->is_number() ? found->value<double>() : std::nullopt;
  if (!read || !(*read >= low && *read <= high)) {
    fail(key, fmt::format("must be a number from {} to {}", low, high));
    return;
  }
  value = *read * unit;
}

void TomlReader::number(std::string_view key, std::optional<double>& value, double unit, double low,
                        double high) {
  double read = 0.0;
  number(key, read, unit, low, high);
  if (has(key)) value = read;
}

void TomlReader::integer(std::string_view key, int& value, int low, int high) {
  double read = value;
  number(key, read, 1.0, low, high);
  value = static_cast<int>(read);
  if (static_cast<double>(value) != read) fail(key, "must be a whole number");
}

void TomlReader::vector(std::string_view key, std::array<double, 3>& value, double unit) {
  const auto* found = node(key);
  if (found == nullptr) return;
  const auto* list = found->as_array();
  if (list == nullptr || list->size() != 3 || !list->is_homogeneous() || !(*list)[0].is_number()) {
    fail(key, "must be three numbers, such as [0.0, 0.0, 0.0]", "write all three with a decimal point");
    return;
  }
  for (std::size_t i = 0; i < 3; ++i) value[i] = *(*list)[i].value<double>() * unit;
}

void TomlReader::texts(std::string_view key, std::array<std::string, 3>& value) {
  const auto* found = node(key);
  if (found == nullptr) return;
  const auto* list = found->as_array();
  if (list == nullptr || list->size() != 3 || !list->is_homogeneous(toml::node_type::string)) {
    fail(key, "must be three texts in quotes");
    return;
  }
  for (std::size_t i = 0; i < 3; ++i) value[i] = *(*list)[i].value<std::string>();
}

void TomlReader::texts(std::string_view key, std::vector<std::string>& value) {
  const auto* found = node(key);
  if (found == nullptr) return;
  const auto* list = found->as_array();
  if (list == nullptr || (!list->empty() && !list->is_homogeneous(toml::node_type::string))) {
    fail(key, "must be a list of texts in quotes");
    return;
  }
  value.clear();
  for (const auto& entry : *list) value.push_back(*entry.value<std::string>());
}

void TomlReader::numbers(std::string_view key, std::vector<double>& value) {
  const auto* found = node(key);
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
    text(name, values[name]);
  }
}

std::size_t TomlReader::choice(std::string_view key, const std::vector<std::string_view>& words,
                               std::size_t fallback) {
  std::string word;
  const bool given = has(key);
  text(key, word);
  if (!given || problem_->error) return fallback;
  const auto found = std::find(words.begin(), words.end(), word);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  fail(key, fmt::format("is '{}'", word), fmt::format("valid: {}", fmt::join(words, ", ")));
  return fallback;
}

TomlReader TomlReader::table(std::string_view key) {
  const auto* found = node(key);
  const auto* inner = found != nullptr ? found->as_table() : nullptr;
  if (found != nullptr && inner == nullptr) fail(key, "must be a table");
  return TomlReader(inner, full_name(key), *problem_);
}

const toml::array* TomlReader::array(std::string_view key) {
  const auto* found = node(key);
  const auto* list = found != nullptr ? found->as_array() : nullptr;
  if (found != nullptr && list == nullptr) fail(key, "must be a list");
  return list;
}

void TomlReader::require(std::string_view key, const std::string& purpose) {
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
