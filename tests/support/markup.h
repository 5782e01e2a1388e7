#pragma once

/// What is to be read of a page.

#include <gtest/gtest.h>
#include <string>

namespace imuscope::test {

/// The page without comments and without what is inside <script> and <style>.
inline std::string markup_of(const std::string& page) {
  std::string markup;
  std::size_t begin = 0;
  const auto skip = [&](std::size_t from, const char* end_mark) {
    const std::size_t end = page.find(end_mark, from);
    EXPECT_NE(end, std::string::npos) << "unclosed before " << end_mark;
    return end;
  };
  while (begin < page.size()) {
    if (page.compare(begin, 4, "<!--") == 0) {
      begin = skip(begin, "-->") + 3;
    } else if (page.compare(begin, 7, "<script") == 0 || page.compare(begin, 6, "<style") == 0) {
      const bool script = page[begin + 2] == 'c';
      const std::size_t open_end = skip(begin, ">") + 1;
      markup += page.substr(begin, open_end - begin);
      begin = skip(open_end, script ? "</script>" : "</style>");
    } else {
      markup += page[begin++];
    }
  }
  return markup;
}

/// The same with a line for each element.
inline std::string lines_of_markup(const std::string& page) {
  std::string text;
  for (const char c : markup_of(page)) {
    if (c == '<' && !text.empty() && text.back() == '>') text += '\n';
    text += c;
  }
  return text;
}

}  // namespace imuscope::test
