#pragma once

/// The piece of a file that is being looked at. Non-real-time: allocates. Thread: one.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "base/result.h"
#include "logs/mcap/records.h"

namespace imuscope::flight_log {

class Window {
 public:
  /// Errors (kWork): a file that is not there or cannot be read.
  static Result<Window> open(const std::filesystem::path& file);

  /// Up to `n` bytes from here on, fewer at the end of the file; valid until the next call.
  mcap::Bytes peek(std::size_t n);
  void skip(std::uint64_t n) { position_ += n; }
  void go_to(std::uint64_t position) { position_ = position; }
  [[nodiscard]] std::uint64_t position() const noexcept { return position_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

 private:
  Window(std::ifstream in, std::uint64_t size) : in_(std::move(in)), size_(size) {}
  std::ifstream in_;
  std::uint64_t size_;
  std::uint64_t position_ = 0;
  std::string piece_;
  std::uint64_t piece_begin_ = 0;
};

}  // namespace imuscope::flight_log
