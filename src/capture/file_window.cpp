#include "capture/file_window.h"

#include <algorithm>

namespace imuscope {

namespace {

constexpr std::size_t kWindowBytes = std::size_t{1} << 16U;  // read at once

}  // namespace

std::span<const std::uint8_t> FileWindow::look(std::size_t n) {
  while (end_ - at_ < n && file_) {
    std::copy(bytes_.begin() + static_cast<std::ptrdiff_t>(at_),
              bytes_.begin() + static_cast<std::ptrdiff_t>(end_), bytes_.begin());
    end_ -= at_;
    at_ = 0;
    if (bytes_.size() < end_ + kWindowBytes) bytes_.resize(end_ + kWindowBytes);
    file_.read(reinterpret_cast<char*>(bytes_.data() + end_), static_cast<std::streamsize>(kWindowBytes));
    end_ += static_cast<std::size_t>(file_.gcount());
  }
  return {bytes_.data() + at_, end_ - at_};
}

}  // namespace imuscope
