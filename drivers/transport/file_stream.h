#pragma once

/// A raw dump of a device, read by read. Beside X.bin may lie X.arrivals.csv (byte_offset,n_bytes,arrival_ns
/// of each read): then the reads come back as they were. Without it the dump comes in blocks that have no
/// arrival.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "base/time.h"

namespace imuscope {

class FileStream {
 public:
  struct Read {
    std::span<const std::uint8_t> bytes;  ///< valid until the next call
    HostTime arrival{};                   ///< only where has_arrivals()
  };

  /// Opens a dump and, where it is there, the list of its arrivals ("X.arrivals.csv" for "X.bin").
  static Result<FileStream> open(const std::filesystem::path& file);

  [[nodiscard]] bool has_arrivals() const noexcept { return has_arrivals_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  /// The next read; nothing at the end. Bytes behind the last listed read (the recorder was killed between
  /// the two files) come with its arrival.
  Result<std::optional<Read>> next();

 private:
  struct Listed {
    std::uint64_t n_bytes = 0;
    HostTime arrival{};
  };
  Result<std::optional<Listed>> next_listed();

  std::filesystem::path file_;
  std::filesystem::path arrivals_file_;
  std::ifstream bytes_;
  std::ifstream arrivals_;
  bool has_arrivals_ = false;
  std::uint64_t size_ = 0;
  std::uint64_t position_ = 0;
  std::uint64_t line_ = 0;
  HostTime last_arrival_{};
  std::vector<std::uint8_t> buffer_;
};

}  // namespace imuscope
