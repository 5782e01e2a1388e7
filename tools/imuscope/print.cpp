#include "print.h"

#include <cstdio>

#include "base/text.h"

namespace imuscope::cli {

namespace {

/// Tabs part the columns of PX4's parameter files, and do no more on a terminal than spaces.
constexpr std::string_view kLayout = "\n\t";

}  // namespace

std::string for_terminal(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const auto end = text.find_first_of(kLayout);
    result += printable(text.substr(0, end));
    if (end == std::string_view::npos) break;
    result += text[end];
    text.remove_prefix(end + 1);
  }
  return result;
}

void say_text(std::string_view text) { fmt::print("{}", for_terminal(text)); }

void say_aside_text(std::string_view text) { fmt::print(stderr, "{}", for_terminal(text)); }

}  // namespace imuscope::cli
