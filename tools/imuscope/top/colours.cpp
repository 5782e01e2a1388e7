#include "tools/imuscope/top/colours.h"

#include <unistd.h>

#include <array>
#include <cctype>
#include <cstdlib>
#include <string_view>

namespace imuscope::top {
namespace {

// Select graphic rendition, ECMA-48 8.3.117.
constexpr std::string_view kBold = "\033[1m";
constexpr std::string_view kRed = "\033[1;31m";
constexpr std::string_view kGreen = "\033[32m";
constexpr std::string_view kYellow = "\033[33m";
constexpr std::string_view kPlain = "\033[0m";

struct Word {
  std::string_view word;
  std::string_view colour;
};

/// States of the service, of devices and of S-IMUs.
constexpr std::array<Word, 15> kWords{{{"running", kGreen},
                                       {"streaming", kGreen},
                                       {"calibrated", kGreen},
                                       {"starting", kYellow},
                                       {"aligning", kYellow},
                                       {"degraded", kYellow},
                                       {"connecting", kYellow},
                                       {"configuring", kYellow},
                                       {"converging", kYellow},
                                       {"looking for its mounting", kYellow},
                                       {"waiting for samples", kYellow},
                                       {"not recording", kYellow},
                                       {"no line", kRed},
                                       {"line down", kRed},
                                       {"failed", kRed}}};

bool is_part_of_a_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
}

/// Where `word` stands by itself; npos where it does not.
std::size_t find_word(std::string_view line, std::string_view word) {
  for (std::size_t at = line.find(word); at != std::string_view::npos; at = line.find(word, at + 1)) {
    const bool begins = at == 0 || !is_part_of_a_word(line[at - 1]);
    const std::size_t end = at + word.size();
    const bool ends = end == line.size() || !is_part_of_a_word(line[end]);
    if (begins && ends) return at;
  }
  return std::string_view::npos;
}

/// "DEVICE      role ...": the first word in capitals.
bool is_heading(std::string_view line) {
  constexpr std::size_t kShortest = 4;
  const std::string_view first = line.substr(0, line.find(' '));
  if (first.size() < kShortest) return false;
  for (const char c : first) {
    if (c < 'A' || c > 'Z') return false;
  }
  return true;
}

std::string painted(std::string_view line, std::size_t at, std::size_t size, std::string_view colour) {
  std::string out(line.substr(0, at));
  out.append(colour).append(line.substr(at, size)).append(kPlain).append(line.substr(at + size));
  return out;
}

}  // namespace

bool colours_wanted() {
  const char* no_colour = std::getenv("NO_COLOR");
  if (no_colour != nullptr && *no_colour != '\0') return false;
  const char* terminal = std::getenv("TERM");
  return isatty(STDOUT_FILENO) == 1 && terminal != nullptr && std::string_view(terminal) != "dumb";
}

std::string coloured(const std::string& line) {
  if (line.starts_with("!!")) return painted(line, 0, line.size(), kRed);
  if (is_heading(line)) return painted(line, 0, line.size(), kBold);
  // The first that stands in the line: its state, before any reason in words.
  std::size_t first = std::string::npos;
  const Word* found = nullptr;
  for (const Word& word : kWords) {
    const std::size_t at = find_word(line, word.word);
    if (at >= first) continue;
    first = at;
    found = &word;
  }
  return found == nullptr ? line : painted(line, first, found->word.size(), found->colour);
}

}  // namespace imuscope::top
