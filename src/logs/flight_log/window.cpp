#include "logs/flight_log/window.h"

#include <fmt/format.h>
#include <algorithm>
#include <cerrno>
#include <cstring>

namespace imuscope::flight_log {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 20U;

}  // namespace

Result<Window> Window::open(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error))
    return work_error(fmt::format("{}: no such file", file.string()));
  if (!std::filesystem::is_regular_file(file, error))
    return work_error(fmt::format("{}: is no file", file.string()));
  std::ifstream in(file, std::ios::binary);
  if (!in) return work_error(fmt::format("{}: cannot be read ({})", file.string(), std::strerror(errno)));
  const std::uint64_t size = std::filesystem::file_size(file, error);
  return Window(std::move(in), error ? 0 : size);
}

mcap::Bytes Window::peek(std::size_t n) {
  if (position_ >= size_) return {};
  const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(n, size_ - position_));
  const bool is_there = position_ >= piece_begin_ && position_ + wanted <= piece_begin_ + piece_.size();
  if (!is_there) {
    piece_begin_ = position_;
    piece_.resize(std::max(wanted, kPiece));
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(position_));
    in_.read(piece_.data(), static_cast<std::streamsize>(piece_.size()));
    piece_.resize(static_cast<std::size_t>(std::max<std::streamsize>(in_.gcount(), 0)));
  }
  const mcap::Bytes piece =
      mcap::bytes_of(piece_).subspan(static_cast<std::size_t>(position_ - piece_begin_));
  return piece.first(std::min(wanted, piece.size()));
}

}  // namespace imuscope::flight_log
