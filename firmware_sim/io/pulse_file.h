#pragma once

/// Where the newest pulse lies for whoever plays the kernel's part towards the program under test: a file
/// that holds its record (pulse_line.h) and nothing else.

#include <string>
#include <tl/expected.hpp>

#include "firmware_sim/io/line_end.h"

namespace imusim {

class PulseFile : public LineEnd {
 public:
  /// @return what went wrong, in one sentence
  static tl::expected<PulseFile, std::string> open(const std::string& path);

  PulseFile(PulseFile&& other) noexcept;
  PulseFile& operator=(PulseFile&&) = delete;
  PulseFile(const PulseFile&) = delete;
  PulseFile& operator=(const PulseFile&) = delete;
  /// The file goes with it, as a device that is unplugged does.
  ~PulseFile() override;

  std::size_t write(std::span<const std::uint8_t> bytes) override;
  Bytes read() override { return {}; }
  [[nodiscard]] int baud() const override { return 0; }

 private:
  PulseFile(int file, std::string path) : file_(file), path_(std::move(path)) {}
  int file_;
  std::string path_;
};

}  // namespace imusim
