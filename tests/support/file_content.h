#pragma once

/// A file's bytes; nothing where it cannot be read.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace imuscope::test {

inline std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace imuscope::test
