#include "tools/imuscope/top/terminal.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <algorithm>

#include "tools/imuscope/top/colours.h"

namespace imuscope::top {

namespace {

// ECMA-48 sequences that every terminal of the last thirty years knows.
constexpr const char* kEnter = "\033[?1049h\033[?25l";  // alternate page, no cursor
constexpr const char* kLeave = "\033[?25h\033[?1049l";
constexpr const char* kHome = "\033[H";
constexpr const char* kEndOfLine = "\033[K\r\n";
constexpr const char* kEndOfPage = "\033[J";

void write_all(const std::string& text) {
  // A terminal that is gone shows in the next read of a key.
  [[maybe_unused]] const auto written = ::write(STDOUT_FILENO, text.data(), text.size());
}

constexpr bool continues_character(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

}  // namespace

std::string cut(const std::string& text, std::size_t columns) {
  std::size_t characters = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (continues_character(text[i])) continue;
    if (characters++ == columns) return text.substr(0, i);
  }
  return text;
}

void print(const std::vector<std::string>& lines) {
  const bool colours = colours_wanted();
  std::string page;
  for (const std::string& line : lines) page += (colours ? coloured(line) : line) + "\n";
  write_all(page);
}

Terminal::Terminal() : colours_(colours_wanted()) {
  tcgetattr(STDIN_FILENO, &before_);
  termios raw = before_;
  raw.c_lflag &= static_cast<tcflag_t>(~(ICANON | ECHO));
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  write_all(kEnter);
}

Terminal::~Terminal() {
  write_all(kLeave);
  tcsetattr(STDIN_FILENO, TCSANOW, &before_);
}

void Terminal::draw(const std::vector<std::string>& lines) {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_row == 0) size = {24, 80, 0, 0};
  const std::size_t rows = std::min<std::size_t>(lines.size(), size.ws_row - 1U);
  std::string page = kHome;
  for (std::size_t i = 0; i < rows; ++i) {
    const auto& line = i + 1 == rows ? lines.back() : lines[i];
    // Cut first: a colour has no width.
    const std::string shown = cut(line, size.ws_col);
    page += (colours_ ? coloured(shown) : shown) + kEndOfLine;
  }
  write_all(page + kEndOfPage);
}

std::optional<char> Terminal::key() const {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  char c = 0;
  if (::poll(&input, 1, 0) <= 0 || ::read(STDIN_FILENO, &c, 1) != 1) return std::nullopt;
  return c;
}

}  // namespace imuscope::top
