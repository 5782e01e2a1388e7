#pragma once

/// Writes an LCM event log so that a kill at any moment leaves a readable file.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "capture/seal.h"
#include "publish/channel_name.h"

namespace imuscope {

/// Collects records in memory and hands them to the kernel in whole records at flush(): what was flushed
/// survives the death of the process. Thread: one, non-real-time.
///
/// When the disk refuses (full, removed), the file is cut back to its last whole record, what could not be
/// written is counted as lost, and the next flush tries again. When somebody removed the file, all that was
/// in it is counted as lost.
class CaptureWriter {
 public:
  /// Creates the file and its folder. An existing file is never overwritten: that is an error.
  /// @param channel_prefix  of the seals and the index
  /// @param file_number     within the capture
  static Result<CaptureWriter> create(const std::filesystem::path& path,
                                      std::string_view channel_prefix = kDefaultChannelPrefix,
                                      int file_number = 0);

  CaptureWriter(CaptureWriter&& other) noexcept;
  CaptureWriter& operator=(CaptureWriter&&) = delete;
  /// Flushes; close() tells whether that worked.
  ~CaptureWriter();

  /// Adds one record to those waiting.
  /// @param channel 1..63 characters
  void append(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> data);

  /// Bytes waiting for flush().
  [[nodiscard]] std::size_t pending_bytes() const noexcept { return pending_.size(); }

  /// Seals all waiting records and hands them to the kernel.
  Result<void> flush();

  /// Waits until the disk has everything that was flushed, and the file's name.
  Result<void> sync();

  /// Somebody removed the file: what is written goes nowhere.
  [[nodiscard]] bool is_removed() const noexcept;

  /// Flushes, adds the index, waits until the disk has everything, closes.
  Result<void> close();

  [[nodiscard]] std::uint64_t bytes_written() const noexcept { return bytes_written_; }
  [[nodiscard]] std::uint64_t records_written() const noexcept { return records_written_; }
  [[nodiscard]] std::uint64_t records_lost() const noexcept { return records_lost_; }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  CaptureWriter(std::filesystem::path path, int file, OutputFolder folder)
      : path_(std::move(path)), file_(file), folder_(std::move(folder)) {}
  void put(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> data);
  void seal();
  Result<void> write_pending();
  void drop_pending() noexcept;
  Result<void> give_up_pending(const char* what, int error);

  std::filesystem::path path_;
  int file_;
  OutputFolder folder_;
  std::string seal_channel_;
  std::string index_channel_;
  int file_number_ = 0;
  bool name_is_safe_ = false;
  Sealer sealer_;
  std::uint64_t records_synced_ = 0;
  std::vector<std::uint8_t> pending_;
  std::size_t unsealed_bytes_ = 0;
  std::uint64_t pending_records_ = 0;  // without seals
  std::int64_t pending_begin_ = 0;     // number of the first that waits
  std::int64_t next_number_ = 0;
  std::uint64_t bytes_written_ = 0;  // also the file's length up to its last whole record
  std::uint64_t records_written_ = 0;
  std::uint64_t records_lost_ = 0;
};

}  // namespace imuscope
