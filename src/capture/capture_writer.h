#pragma once

/// Writes an LCM event log so that a kill at any moment leaves a readable file.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// Collects records in memory and hands them to the kernel in whole records at flush(): what was flushed
/// survives the death of the process. Thread: one, of the soft world.
///
/// When the disk refuses (full, removed), the file is cut back to its last whole record, what could not be
/// written is counted as lost, and the next flush tries again. When somebody removed the file, all that was
/// in it is counted as lost.
class CaptureWriter {
 public:
  /// Creates the file and its folder. An existing file is never overwritten: that is an error.
  static Result<CaptureWriter> create(const std::filesystem::path& path);

  CaptureWriter(CaptureWriter&& other) noexcept;
  CaptureWriter& operator=(CaptureWriter&&) = delete;
  /// Flushes; close() tells whether that worked.
  ~CaptureWriter();

  /// Adds one record to those waiting.
  /// @param channel 1..63 characters
  void append(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> data);

  /// Bytes waiting for flush().
  [[nodiscard]] std::size_t pending_bytes() const noexcept { return pending_.size(); }

  /// Hands all waiting records to the kernel.
  Result<void> flush();

  /// Somebody removed the file: what is written goes nowhere.
  [[nodiscard]] bool is_removed() const noexcept;

  /// Flushes, waits until the disk has everything, closes.
  Result<void> close();

  [[nodiscard]] std::uint64_t bytes_written() const noexcept { return bytes_written_; }
  [[nodiscard]] std::uint64_t records_written() const noexcept { return records_written_; }
  [[nodiscard]] std::uint64_t records_lost() const noexcept { return records_lost_; }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  CaptureWriter(std::filesystem::path path, int file) : path_(std::move(path)), file_(file) {}
  Result<void> give_up_pending(const char* what, int error);

  std::filesystem::path path_;
  int file_;
  std::vector<std::uint8_t> pending_;
  std::uint64_t pending_records_ = 0;
  std::int64_t next_number_ = 0;
  std::uint64_t bytes_written_ = 0;  // also the file's length up to its last whole record
  std::uint64_t records_written_ = 0;
  std::uint64_t records_lost_ = 0;
};

}  // namespace imuscope
