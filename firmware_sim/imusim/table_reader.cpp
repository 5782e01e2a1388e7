#include "firmware_sim/imusim/table_reader.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace imusim {
namespace {

/// Levenshtein distance.
std::size_t edits_between(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

void Problem::note(const toml::source_region& where, const std::string& what) {
  if (text.empty()) text = fmt::format("{}:{}: {}", file, where.begin.line, what);
}

const toml::node* TableReader::node(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.emplace_back(key);
  return table_ == nullptr ? nullptr : table_->get(key);
}

bool TableReader::has(std::string_view key) { return node(key) != nullptr; }

void TableReader::fail(std::string_view key, const std::string& what) {
  const toml::node* found = node(key);
  if (found != nullptr)
    problem_->note(found->source(), name_.empty() ? fmt::format("{} {}", key, what)
                                                  : fmt::format("{} of [{}] {}", key, name_, what));
  else if (table_ != nullptr)
    problem_->note(table_->source(), fmt::format("[{}] {}", name_, what));
}

void TableReader::number(std::string_view key, double& target, double unit, double low, double high) {
  const toml::node* found = node(key);
  if (found == nullptr) return;
  const auto value = found->is_number() ? found->value<double>() : std::nullopt;
  if (!value || !(*value >= low && *value <= high))
    return fail(key, fmt::format("must be a number from {} to {}", low, high));
  target = *value * unit;
}

void TableReader::whole(std::string_view key, std::int64_t& target, std::int64_t low, std::int64_t high) {
  const toml::node* found = node(key);
  if (found == nullptr) return;
  const auto value = found->value_exact<std::int64_t>();
  if (!value || *value < low || *value > high)
    return fail(key, fmt::format("must be a whole number from {} to {}", low, high));
  target = *value;
}

std::vector<double> TableReader::numbers(std::string_view key, std::size_t count, const toml::node& node) {
  const toml::array* list = node.as_array();
  std::vector<double> values;
  if (list != nullptr && list->size() == count) {
    for (const toml::node& item : *list) {
      const auto value = item.is_number() ? item.value<double>() : std::nullopt;
      if (value && std::isfinite(*value)) values.push_back(*value);
    }
  }
  if (values.size() != count) {
    fail(key, fmt::format("must hold {} numbers in brackets{}", count,
                          node.as_array() != nullptr && count == 3 ? "" : ", such as [0, 0, 0]"));
    values.clear();
  }
  return values;
}

void TableReader::vector(std::string_view key, Eigen::Vector3d& target, double unit) {
  const toml::node* found = node(key);
  if (found == nullptr) return;
  const std::vector<double> values = numbers(key, 3, *found);
  if (!values.empty()) target = unit * Eigen::Vector3d(values[0], values[1], values[2]);
}

void TableReader::matrix(std::string_view key, Eigen::Matrix3d& target, double unit) {
  const toml::node* found = node(key);
  if (found == nullptr) return;
  const toml::array* rows = found->as_array();
  if (rows == nullptr || rows->size() != 3) return fail(key, "must be three rows of three numbers");
  for (Eigen::Index row = 0; row < 3; ++row) {
    const std::vector<double> values = numbers(key, 3, (*rows)[static_cast<std::size_t>(row)]);
    if (values.empty()) return;
    target.row(row) = unit * Eigen::RowVector3d(values[0], values[1], values[2]);
  }
}

void TableReader::text(std::string_view key, std::string& target) {
  const toml::node* found = node(key);
  if (found == nullptr) return;
  const auto value = found->value_exact<std::string>();
  if (!value || value->empty()) return fail(key, "must be a text");
  target = *value;
}

std::size_t TableReader::choice(std::string_view key, const std::vector<std::string_view>& words,
                                std::size_t otherwise) {
  const toml::node* found = node(key);
  if (found == nullptr) return otherwise;
  const auto value = found->value_exact<std::string>();
  const auto place = value ? std::find(words.begin(), words.end(), *value) : words.end();
  if (place == words.end()) {
    fail(key, fmt::format("must be one of: {}", fmt::join(words, ", ")));
    return otherwise;
  }
  return static_cast<std::size_t>(place - words.begin());
}

TableReader TableReader::table(std::string_view key) {
  const toml::node* found = node(key);
  const toml::table* inner = found == nullptr ? nullptr : found->as_table();
  if (found != nullptr && inner == nullptr) fail(key, "must be a table");
  return {inner, name_.empty() ? std::string(key) : fmt::format("{}.{}", name_, key), *problem_};
}

std::vector<TableReader> TableReader::tables(std::string_view key) {
  std::vector<TableReader> readers;
  const toml::node* found = node(key);
  if (found == nullptr) return readers;
  const toml::array* list = found->as_array();
  const std::string inner_name = name_.empty() ? std::string(key) : fmt::format("{}.{}", name_, key);
  if (list == nullptr || !list->is_homogeneous<toml::table>()) {
    fail(key, fmt::format("must be a list of tables: write [[{}]]", inner_name));
    return readers;
  }
  for (const toml::node& item : *list) readers.push_back({item.as_table(), inner_name, *problem_});
  return readers;
}

void TableReader::refuse_unknown_keys() {
  if (table_ == nullptr) return;
  for (const auto& [key, value] : *table_) {
    if (std::find(known_.begin(), known_.end(), key.str()) != known_.end()) continue;
    const std::string_view unknown = key.str();
    const auto nearest = std::min_element(known_.begin(), known_.end(), [&](const auto& a, const auto& b) {
      return edits_between(a, unknown) < edits_between(b, unknown);
    });
    problem_->note(key.source(), fmt::format("[{}] has no key '{}'; the nearest is '{}'", name_, unknown,
                                             nearest == known_.end() ? "" : *nearest));
  }
}

}  // namespace imusim
