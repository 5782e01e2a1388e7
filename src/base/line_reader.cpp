#include "base/line_reader.h"

#include <streambuf>

namespace imuscope {

bool read_line(std::istream& in, std::string& line, std::size_t longest, std::uint64_t& passed) {
  using Traits = std::streambuf::traits_type;
  line.clear();
  if (!in.good()) return false;
  std::uint64_t taken = 0;
  for (;;) {
    const auto next = in.rdbuf()->sbumpc();
    if (Traits::eq_int_type(next, Traits::eof())) {
      in.setstate(taken == 0 ? std::ios::eofbit | std::ios::failbit : std::ios::eofbit);
      break;
    }
    ++taken;
    const char letter = Traits::to_char_type(next);
    if (letter == '\n') break;
    if (line.size() <= longest) line.push_back(letter);
  }
  passed += taken;
  return taken > 0;
}

bool read_line(std::istream& in, std::string& line, std::size_t longest) {
  std::uint64_t passed = 0;
  return read_line(in, line, longest, passed);
}

}  // namespace imuscope
