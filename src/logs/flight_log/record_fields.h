#pragma once

/// Numbers of a record by the names of its fields, as logs describe their own records.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "logs/mcap/records.h"

namespace imuscope::flight_log {

enum class NumberKind : std::uint8_t { kI8, kU8, kI16, kU16, kI32, kU32, kI64, kU64, kF32, kF64 };
[[nodiscard]] std::size_t size_of(NumberKind kind) noexcept;

/// Where the numbers of a record are.
class Layout {
 public:
  /// @param count  of numbers one after the other
  /// @param scale  of one of the field's units
  void add(std::string name, NumberKind kind, std::size_t count = 1, double scale = 1.0);
  /// Bytes of something that holds no number.
  void pass(std::size_t bytes) { size_ += bytes; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  friend class Fields;
  struct Entry {
    std::string name;
    NumberKind kind;
    std::size_t offset;
    std::size_t count;
    double scale;
  };
  std::vector<Entry> entries_;
  std::size_t size_ = 0;
};

/// One record. The end of it may be missing.
class Fields {
 public:
  Fields(const Layout& layout, mcap::Bytes record) noexcept : layout_(layout), record_(record) {}
  [[nodiscard]] bool has(std::string_view name) const noexcept { return entry(name) != nullptr; }
  [[nodiscard]] bool is_float(std::string_view name) const noexcept;
  /// Nothing where the record has no such field, or ends before it.
  [[nodiscard]] std::optional<double> number(std::string_view name, std::size_t index = 0) const noexcept;
  /// The first of these that there is.
  [[nodiscard]] std::optional<double> first_of(std::initializer_list<std::string_view> names) const noexcept;
  [[nodiscard]] std::optional<std::array<double, 3>> three(std::string_view x, std::string_view y,
                                                           std::string_view z) const noexcept;
  /// Of an array.
  [[nodiscard]] std::optional<std::array<double, 3>> three(std::string_view name) const noexcept;

 private:
  [[nodiscard]] const Layout::Entry* entry(std::string_view name) const noexcept;
  const Layout& layout_;
  mcap::Bytes record_;
};

}  // namespace imuscope::flight_log
