#pragma once

#include <sys/mman.h>
#include <unistd.h>
#include <string>

#include "tests/fuzz/fuzz.h"

namespace imuscope::fuzz {

/// The input as a file that never touches a disk.
class FileInMemory {
 public:
  FileInMemory(const std::uint8_t* data, std::size_t size) : fd_(::memfd_create("input", MFD_CLOEXEC)) {
    require(::write(fd_, data, size) == static_cast<ssize_t>(size), "the input is in the file");
  }
  FileInMemory(const FileInMemory&) = delete;
  FileInMemory& operator=(const FileInMemory&) = delete;
  ~FileInMemory() { ::close(fd_); }
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  int fd_;
};

}  // namespace imuscope::fuzz
