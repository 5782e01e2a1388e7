#pragma once

/// A recorded answer (recorded_answer.h) as it is written: lines of words and numbers.

#include <fmt/format.h>

#include <cmath>
#include <concepts>
#include <ranges>
#include <string>
#include <string_view>
#include <type_traits>

namespace imuscope::test {

class Answer {
 public:
  /// One line of all of them, a space before each but the first: words, numbers at nine significant digits, ranges, what
  /// is optional, matrices column by column.
  template <typename... Values>
  void line(const Values&... values) {
    (add(values), ...);
    text_ += '\n';
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void word(std::string_view text) {
    if (!text_.empty() && text_.back() != '\n') text_ += ' ';
    text_ += text;
  }

  template <typename Value>
  void add(const Value& value) {
    if constexpr (std::is_enum_v<Value>) {
      add(static_cast<std::underlying_type_t<Value>>(value));
    } else if constexpr (std::is_same_v<Value, bool>) {
      word(value ? "true" : "false");
    } else if constexpr (std::is_same_v<Value, char>) {
      word({&value, 1});
    } else if constexpr (std::convertible_to<Value, std::string_view>) {
      word(value);
    } else if constexpr (std::integral<Value>) {
      word(std::to_string(value));
    } else if constexpr (std::floating_point<Value>) {
      word(std::isnan(value) ? "nan" : fmt::format("{:.9g}", value));
    } else if constexpr (requires { value.has_value(); }) {
      value ? add(*value) : word("none");
    } else if constexpr (requires { value.eval().cols(); }) {
      const auto& matrix = value.eval();
      for (auto c = 0 * matrix.cols(); c < matrix.cols(); ++c) {
        for (auto r = 0 * matrix.rows(); r < matrix.rows(); ++r) add(matrix(r, c));
      }
    } else {
      static_assert(std::ranges::range<Value>);
      for (const auto& one : value) add(one);
    }
  }

  std::string text_;
};

}  // namespace imuscope::test
