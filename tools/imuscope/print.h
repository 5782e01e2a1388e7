#pragma once

/// What a command prints: names, remarks and messages in it may come from a stranger's capture or folder.

#include <fmt/format.h>
#include <string>
#include <string_view>
#include <utility>

namespace imuscope::cli {

/// The text without what a terminal would act upon (base/text.h, printable()), but for the ends of its lines
/// and tabs.
[[nodiscard]] std::string for_terminal(std::string_view text);

/// Writes for_terminal() to standard output; nothing else in these commands writes there.
void say_text(std::string_view text);
/// The same, to standard error.
void say_aside_text(std::string_view text);

/// Formats as fmt::print() does, and writes as say_text().
template <typename... Values>
void say(fmt::format_string<Values...> format, Values&&... values) {
  say_text(fmt::format(format, std::forward<Values>(values)...));
}
/// The same, to standard error.
template <typename... Values>
void say_aside(fmt::format_string<Values...> format, Values&&... values) {
  say_aside_text(fmt::format(format, std::forward<Values>(values)...));
}

}  // namespace imuscope::cli
