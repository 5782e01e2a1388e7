#include "firmware_sim/io/pulse_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace imusim {

tl::expected<PulseFile, std::string> PulseFile::open(const std::string& path) {
  constexpr int kEverybodyReads = 0644;
  const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, kEverybodyReads);
  if (file < 0) return tl::unexpected(fmt::format("cannot make {}: {}", path, std::strerror(errno)));
  return PulseFile(file, path);
}

PulseFile::PulseFile(PulseFile&& other) noexcept
    : file_(std::exchange(other.file_, -1)), path_(std::move(other.path_)) {}

PulseFile::~PulseFile() {
  if (file_ < 0) return;
  ::close(file_);
  ::unlink(path_.c_str());
}

std::size_t PulseFile::write(std::span<const std::uint8_t> bytes) {
  const ssize_t n = ::pwrite(file_, bytes.data(), bytes.size(), 0);
  return n == static_cast<ssize_t>(bytes.size()) ? 0 : bytes.size();
}

}  // namespace imusim
