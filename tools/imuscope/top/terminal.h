#pragma once

/// A terminal as a page that is drawn again and again, with keys that come at once. Restores the terminal in
/// its destructor.

#include <termios.h>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace imuscope::top {

class Terminal {
 public:
  /// Takes over the terminal of standard input and output.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// Shows the lines from the top, cut to what the terminal holds; the last one stays visible.
  void draw(const std::vector<std::string>& lines);
  /// A key, if one was pressed.
  [[nodiscard]] std::optional<char> key() const;

 private:
  bool colours_;
  termios before_{};
};

/// Writes the lines once to standard output, in colours where they are wanted. Precondition: they are
/// printable, as lines_of() makes them.
void print(const std::vector<std::string>& lines);

/// The first `columns` characters of UTF-8 text.
[[nodiscard]] std::string cut(const std::string& text, std::size_t columns);

}  // namespace imuscope::top
