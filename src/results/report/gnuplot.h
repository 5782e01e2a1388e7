#pragma once

/// Scripts for gnuplot, a language that can start programs: whatever comes from a file becomes part of one
/// through GnuplotText alone, which quotes it.

#include <fmt/format.h>
#include <concepts>
#include <cstddef>
#include <iterator>
#include <string>
#include <string_view>
#include <type_traits>

namespace imuscope::report {

/// Text of any origin as a string of gnuplot, quotes included: one line, in single quotes, inside which
/// gnuplot knows no escape, no substitution and no end but the quote, in place of which an apostrophe stands.
class GnuplotText {
 public:
  explicit GnuplotText(std::string_view any);
  [[nodiscard]] const std::string& str() const noexcept { return quoted_; }

 private:
  std::string quoted_;
};

/// A word of gnuplot's language written in this program: a literal.
class GnuplotWord {
 public:
  template <std::size_t N>
  consteval GnuplotWord(const char (&literal)[N]) : word_(literal, N - 1) {}  // NOLINT: a literal is a word
  [[nodiscard]] std::string_view str() const noexcept { return word_; }

 private:
  std::string_view word_;
};

/// A number as gnuplot reads it; NaN where it is not finite.
struct GnuplotNumber {
  double value = 0.0;
};

class GnuplotScript;

/// What may stand in a script beside literals.
template <typename T>
concept GnuplotValue = std::integral<T> || std::floating_point<T> || std::same_as<T, GnuplotNumber> ||
    std::same_as<T, GnuplotText> || std::same_as<T, GnuplotWord> || std::same_as<T, GnuplotScript>;

/// A script, or a piece of one. No text gets into it but literals and what GnuplotText quoted.
class GnuplotScript {
 public:
  GnuplotScript() = default;
  /// A piece: fmt's format, a literal, and its values.
  template <GnuplotValue... Values>
  [[nodiscard]] static GnuplotScript of(fmt::format_string<Values...> literal, const Values&... values) {
    GnuplotScript script;
    script.add(literal, values...);
    return script;
  }
  template <GnuplotValue... Values>
  GnuplotScript& add(fmt::format_string<Values...> literal, const Values&... values) {
    fmt::vformat_to(std::back_inserter(text_), literal, fmt::make_format_args(values...));
    return *this;
  }
  GnuplotScript& operator+=(const GnuplotScript& more) {
    text_ += more.text_;
    return *this;
  }
  [[nodiscard]] bool empty() const noexcept { return text_.empty(); }
  [[nodiscard]] const std::string& str() const noexcept { return text_; }

 private:
  std::string text_;
};

}  // namespace imuscope::report

template <>
struct fmt::formatter<imuscope::report::GnuplotText> : fmt::formatter<std::string_view> {
  auto format(const imuscope::report::GnuplotText& text, format_context& context) const {
    return formatter<std::string_view>::format(text.str(), context);
  }
};
template <>
struct fmt::formatter<imuscope::report::GnuplotWord> : fmt::formatter<std::string_view> {
  auto format(const imuscope::report::GnuplotWord& word, format_context& context) const {
    return formatter<std::string_view>::format(word.str(), context);
  }
};
template <>
struct fmt::formatter<imuscope::report::GnuplotScript> : fmt::formatter<std::string_view> {
  auto format(const imuscope::report::GnuplotScript& script, format_context& context) const {
    return formatter<std::string_view>::format(script.str(), context);
  }
};
template <>
struct fmt::formatter<imuscope::report::GnuplotNumber> {
  static constexpr auto parse(format_parse_context& context) { return context.begin(); }
  static auto format(const imuscope::report::GnuplotNumber& number, format_context& context)
      -> format_context::iterator;
};
