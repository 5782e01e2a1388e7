#pragma once

/// The text of a recorded answer: a name and its numbers a line, at nine significant digits.

#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>

namespace imuscope::test {

class AnswerLines {
 public:
  /// A line of words alone.
  void title(std::string_view words) { text_.append(words).append("\n"); }

  /// `name` and what belongs to it: numbers, words, vectors and matrices (Eigen's, arrays). A matrix of several rows
  /// takes as many lines.
  template <typename... Values>
  void add(std::string_view name, const Values&... values) {
    text_.append(name);
    (append(values), ...);
    text_ += '\n';
  }

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void number(double value) {
    char digits[32];
    std::snprintf(digits, sizeof digits, " %.9g", value);
    text_ += digits;
  }

  template <typename Value>
  void append(const Value& value) {
    if constexpr (std::is_enum_v<Value>) {
      append(static_cast<std::underlying_type_t<Value>>(value));
    } else if constexpr (std::is_arithmetic_v<Value>) {
      number(static_cast<double>(value));
    } else if constexpr (std::is_convertible_v<const Value&, std::string_view>) {
      text_.append(" ").append(std::string_view(value));
    } else if constexpr (requires { value.derived(); }) {
      append_matrix(value.derived());
    } else {
      for (const auto& one : value) append(one);
    }
  }

  template <typename Matrix>
  void append_matrix(const Matrix& matrix) {
    const bool is_vector = matrix.cols() == 1 || matrix.rows() == 1;
    for (auto i = 0 * matrix.rows(); i < matrix.rows(); ++i) {
      if (!is_vector) text_ += "\n ";
      for (auto j = 0 * matrix.cols(); j < matrix.cols(); ++j) number(static_cast<double>(matrix(i, j)));
    }
  }

  std::string text_;
};

}  // namespace imuscope::test
