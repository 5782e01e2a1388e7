#include "tests/support/recorded_answer.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// A number at the front of `text`: its value, and how long it is written; length 0 where there is none.
struct Number {
  double value = 0.0;
  std::size_t length = 0;
};

Number number_at(std::string_view text) {
  const bool is_signed = text.size() > 1 && text.front() == '-';
  if (text.empty() || !is_digit(text[is_signed ? 1 : 0])) return {};
  Number number;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number.value);
  if (error != std::errc{}) return {};
  number.length = static_cast<std::size_t>(end - text.data());
  return number;
}

/// A line alike in its words, and in its numbers to what rounding may change.
bool alike(std::string_view a, std::string_view b, double share, double nothing) {
  while (!a.empty() && !b.empty()) {
    const Number of_a = number_at(a);
    const Number of_b = number_at(b);
    if (of_a.length > 0 && of_b.length > 0) {
      const double larger = std::max(std::abs(of_a.value), std::abs(of_b.value));
      if (!(std::abs(of_a.value - of_b.value) <= std::max(share * larger, nothing))) return false;
      a.remove_prefix(of_a.length);
      b.remove_prefix(of_b.length);
      continue;
    }
    if (a.front() != b.front()) return false;
    a.remove_prefix(1);
    b.remove_prefix(1);
  }
  return a.empty() && b.empty();
}

std::vector<std::string_view> lines_of(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    lines.push_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

}  // namespace

std::string first_difference(std::string_view recorded, std::string_view text, double share, double nothing) {
  const auto expected = lines_of(recorded);
  const auto found = lines_of(text);
  for (std::size_t i = 0; i < std::max(expected.size(), found.size()); ++i) {
    const std::string_view before = i < expected.size() ? expected[i] : "(no line)";
    const std::string_view now = i < found.size() ? found[i] : "(no line)";
    const bool both = i < expected.size() && i < found.size();
    if (both && alike(before, now, share, nothing)) continue;
    return "line " + std::to_string(i + 1) + ": recorded \"" + std::string(before) + "\", now \"" +
           std::string(now) + '"';
  }
  return {};
}

void expect_recorded(std::string_view name, std::string_view text, double share, double nothing) {
  const auto file = source_path("tests/recorded") / name;
  if (std::getenv("IMUSCOPE_RECORD_ANSWERS") != nullptr) {
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << text;
    GTEST_SKIP() << "wrote " << file.string();
  }
  if (!std::filesystem::exists(file)) {
    FAIL() << file.string() << " is not there; IMUSCOPE_RECORD_ANSWERS=1 writes it";
  }
  EXPECT_EQ(first_difference(content_of(file), text, share, nothing), "") << file.string();
}

}  // namespace imuscope::test
