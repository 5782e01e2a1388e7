#pragma once

/// Words, numbers, texts and signs of a DBC file, with the line they stand on.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace imuscope::dbc {

enum class TokenKind : std::uint8_t {
  kEnd,       ///< of the file
  kWord,      ///< letters, digits, '_'; does not begin with a digit
  kNumber,    ///< with its sign, fraction and exponent
  kText,      ///< in quotation marks
  kSign,      ///< one character
  kOpenText,  ///< a text whose closing quotation mark does not come
};

/// One piece of a DBC file; `text` points into the file's text, which must outlive it.
struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::string_view text;  ///< a text without its quotation marks
  std::size_t line = 1;
  bool begins_line = false;  ///< nothing stands before it on its line, no blanks either
};

/// What a person would call it.
std::string describe(const Token& token);

class Tokens {
 public:
  explicit Tokens(std::string_view file) : rest_(file) { advance(); }

  [[nodiscard]] const Token& current() const { return current_; }
  void advance();

 private:
  void skip_blanks();

  std::string_view rest_;
  std::size_t line_ = 1;
  bool at_line_begin_ = true;
  Token current_;
};

}  // namespace imuscope::dbc
