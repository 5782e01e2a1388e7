#pragma once

/// A set of numbers that come in rows: as large as it has rows, however long they are.

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>

namespace imuscope {

class NumberRanges {
 public:
  /// Adds first, first + 1 .. first + count - 1. Rows may overlap.
  void add(std::int64_t first, std::int64_t count) {
    if (count <= 0) return;
    auto row = rows_.upper_bound(first);
    std::int64_t end = first + count;
    if (row != rows_.begin() && std::prev(row)->second >= first) {
      row = std::prev(row);
      first = row->first;
      end = std::max(end, row->second);
    }
    while (row != rows_.end() && row->first <= end) {
      end = std::max(end, row->second);
      row = rows_.erase(row);
    }
    rows_.emplace(first, end);
  }

  [[nodiscard]] bool contains(std::int64_t number) const {
    const auto after = rows_.upper_bound(number);
    return after != rows_.begin() && number < std::prev(after)->second;
  }

 private:
  std::map<std::int64_t, std::int64_t>
      rows_;  ///< first number, and the one after the last; apart from each other
};

}  // namespace imuscope
