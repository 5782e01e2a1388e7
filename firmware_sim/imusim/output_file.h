#pragma once

/// A file that is written in large pieces and remembers whether all of them went well.

#include <fmt/format.h>
#include <filesystem>
#include <fstream>
#include <string>

#include "firmware_sim/imusim/failure.h"

namespace imusim {

class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path) : path_(path), file_(path, std::ios::binary) {}

  void write(const char* data, std::size_t size) {
    buffer_.append(data, data + size);
    constexpr std::size_t kPiece = 1U << 20U;
    if (buffer_.size() >= kPiece) flush();
  }
  void write(const std::string& text) { write(text.data(), text.size()); }

  Outcome<void> close() {
    flush();
    file_.close();
    if (!file_)
      return failed_work(fmt::format("cannot write {}; is there room, and the permission?", path_.string()));
    return {};
  }

 private:
  void flush() {
    file_.write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    buffer_.clear();
  }

  std::filesystem::path path_;
  std::ofstream file_;
  fmt::memory_buffer buffer_;
};

}  // namespace imusim
