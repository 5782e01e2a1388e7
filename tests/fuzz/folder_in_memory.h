#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>

#include "tests/fuzz/fuzz.h"

namespace imuscope::fuzz {

/// A folder of this process's own for what has to have a name, in memory; gone with the process.
class FolderInMemory {
 public:
  FolderInMemory() {
    std::string name = "/dev/shm/imuscope_fuzz_XXXXXX";
    require(::mkdtemp(name.data()) != nullptr, "a folder can be made in memory");
    path_ = name;
  }
  FolderInMemory(const FolderInMemory&) = delete;
  FolderInMemory& operator=(const FolderInMemory&) = delete;
  ~FolderInMemory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  void put(const std::string& name, std::span<const std::uint8_t> content) const {
    std::ofstream out(path_ / name, std::ios::binary | std::ios::trunc);
    out.write(reinterpret_cast<const char*>(content.data()), static_cast<std::streamsize>(content.size()));
    require(out.good(), "the input is in the file");
  }

 private:
  std::filesystem::path path_;
};

}  // namespace imuscope::fuzz
