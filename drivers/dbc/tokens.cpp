#include "drivers/dbc/tokens.h"

#include <fmt/format.h>
#include <algorithm>
#include <charconv>

#include "base/text.h"

namespace imuscope::dbc {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }

/// Length of the number at the beginning of `text`, 0 where there is none.
std::size_t number_length(std::string_view text) {
  const std::size_t sign = !text.empty() && (text[0] == '+' || text[0] == '-') ? 1 : 0;
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data() + sign, text.data() + text.size(), value);
  // "inf" and "nan" are words here.
  const bool starts = text.size() > sign && (is_digit(text[sign]) || text[sign] == '.');
  if (!starts || error == std::errc::invalid_argument) return 0;
  return static_cast<std::size_t>(end - text.data());
}

}  // namespace

std::string describe(const Token& token) {
  constexpr std::size_t kShown = 80;  // bytes
  const std::string text = one_line(token.text, kShown);
  switch (token.kind) {
    case TokenKind::kEnd:
      return "the end of the file";
    case TokenKind::kText:
      return fmt::format("\"{}\"", text);
    case TokenKind::kOpenText:
      return "a text without its closing quotation mark";
    default:
      return fmt::format("'{}'", text);
  }
}

void Tokens::skip_blanks() {
  while (!rest_.empty()) {
    if (rest_.starts_with(kByteOrderMark)) {
      rest_.remove_prefix(kByteOrderMark.size());
    } else if (rest_.starts_with("//")) {
      rest_.remove_prefix(std::min(rest_.find('\n'), rest_.size()));
    } else if (rest_.front() == '\n') {
      ++line_;
      at_line_begin_ = true;
      rest_.remove_prefix(1);
    } else if (rest_.front() == ' ' || rest_.front() == '\t' || rest_.front() == '\r') {
      at_line_begin_ = false;
      rest_.remove_prefix(1);
    } else {
      return;
    }
  }
}

void Tokens::advance() {
  skip_blanks();
  current_ = {TokenKind::kEnd, {}, line_, at_line_begin_};
  at_line_begin_ = false;
  if (rest_.empty()) return;
  const char first = rest_.front();
  std::size_t length = 1;
  current_.kind = TokenKind::kSign;
  if (is_letter(first)) {
    current_.kind = TokenKind::kWord;
    while (length < rest_.size() && (is_letter(rest_[length]) || is_digit(rest_[length]))) ++length;
  } else if (const std::size_t digits = number_length(rest_); digits > 0) {
    current_.kind = TokenKind::kNumber;
    length = digits;
  } else if (first == '"') {
    std::size_t close = 1;
    while (close < rest_.size() && rest_[close] != '"') close += rest_[close] == '\\' ? 2 : 1;
    if (close >= rest_.size()) {
      current_.kind = TokenKind::kOpenText;
      rest_ = {};
      return;
    }
    current_.kind = TokenKind::kText;
    current_.text = rest_.substr(1, close - 1);
    line_ += static_cast<std::size_t>(std::count(current_.text.begin(), current_.text.end(), '\n'));
    rest_.remove_prefix(close + 1);
    return;
  }
  current_.text = rest_.substr(0, length);
  rest_.remove_prefix(length);
}

}  // namespace imuscope::dbc
