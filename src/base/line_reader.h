#pragma once

/// Lines of a text file of unknown origin.

#include <cstddef>
#include <cstdint>
#include <istream>
#include <string>

namespace imuscope {

/// The next line, without its end, in bounded memory: of a line longer than `longest` bytes come the first
/// `longest` + 1, and the rest is passed over. The stream stands at its end (eof()) where no line end came.
/// @param passed  bytes taken from the stream are added to it
/// @return false where nothing is left
bool read_line(std::istream& in, std::string& line, std::size_t longest, std::uint64_t& passed);
bool read_line(std::istream& in, std::string& line, std::size_t longest);

}  // namespace imuscope
