#include "spool.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

namespace imuscope::cli {
namespace {

Error disk_error(const char* what) {
  return {ErrorKind::kWork,
          fmt::format("a temporary file {}: {}", what, std::generic_category().message(errno)),
          "make room in the folder for temporary files, or name another one in TMPDIR"};
}

}  // namespace

Result<Spool> Spool::create() {
  std::error_code error;
  const auto folder = std::filesystem::temp_directory_path(error);
  std::string name = ((error ? std::filesystem::path("/tmp") : folder) / "imuscope.XXXXXX").string();
  const int fd = mkstemp(name.data());
  if (fd < 0) return tl::unexpected(disk_error("cannot be made"));
  unlink(name.c_str());
  return Spool(fd);
}

Spool::Spool(Spool&& other) noexcept : fd_(std::exchange(other.fd_, -1)), size_(other.size_) {}

Spool& Spool::operator=(Spool&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(size_, other.size_);
  return *this;
}

Spool::~Spool() {
  if (fd_ >= 0) close(fd_);
}

Result<void> Spool::append(std::span<const double> values) {
  auto bytes = std::as_bytes(values);
  auto at = static_cast<off_t>(size_ * sizeof(double));
  while (!bytes.empty()) {
    const ssize_t written = pwrite(fd_, bytes.data(), bytes.size(), at);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return tl::unexpected(disk_error("cannot be written"));
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    at += written;
  }
  size_ += values.size();
  return {};
}

Result<void> Spool::read(std::size_t first, std::span<double> values) const {
  auto bytes = std::as_writable_bytes(values);
  auto at = static_cast<off_t>(first * sizeof(double));
  while (!bytes.empty()) {
    const ssize_t got = pread(fd_, bytes.data(), bytes.size(), at);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return tl::unexpected(disk_error("cannot be read"));
    bytes = bytes.subspan(static_cast<std::size_t>(got));
    at += got;
  }
  return {};
}

}  // namespace imuscope::cli
