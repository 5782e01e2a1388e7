#include "base/line_reader.h"

#include <algorithm>
#include <array>

namespace imuscope {

bool read_line(std::istream& in, std::string& line, std::size_t longest, std::uint64_t& passed) {
  line.clear();
  std::uint64_t taken = 0;
  // In pieces that the stream's own search for the line's end fills: letter by letter it takes far longer.
  std::array<char, 512> piece;
  while (in.good()) {
    in.getline(piece.data(), piece.size());
    const auto n = static_cast<std::size_t>(in.gcount());
    taken += n;
    const std::size_t of_line = in.good() ? n - 1 : n;
    line.append(piece.data(), std::min(of_line, longest + 1 - line.size()));
    if (in.good()) break;
    // The piece was full; or nothing is left behind what the pieces before brought.
    if (!in.bad() && (!in.eof() || taken > 0)) in.clear(in.rdstate() & ~std::ios::failbit);
  }
  passed += taken;
  return taken > 0;
}

bool read_line(std::istream& in, std::string& line, std::size_t longest) {
  std::uint64_t passed = 0;
  return read_line(in, line, longest, passed);
}

}  // namespace imuscope
