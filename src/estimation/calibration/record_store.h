#pragma once

/// Records of one size, kept in memory up to a bound and beyond it in a file that has no name (it vanishes
/// with the program, however that ends). Non-real-time: allocates, writes files. Thread: one.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// Where records may lie.
struct RecordStorage {
  std::size_t memory_bytes_max = 0;
  std::filesystem::path folder;  ///< of the file; on a disk, not in a file system that is memory
};

class RecordStore {
 public:
  /// Opens no file as long as the memory suffices. Precondition: record_size > 0.
  /// @param record_size  doubles of one record
  RecordStore(std::size_t record_size, RecordStorage storage);
  ~RecordStore();
  RecordStore(const RecordStore&) = delete;
  RecordStore& operator=(const RecordStore&) = delete;
  RecordStore(RecordStore&& other) noexcept;
  RecordStore& operator=(RecordStore&&) = delete;

  /// Appends one record. Precondition: record.size() == record_size.
  [[nodiscard]] Result<void> append(std::span<const double> record);
  /// Record `index`, 0 being the oldest. Preconditions: index < size(), out.size() == record_size.
  [[nodiscard]] Result<void> read(std::size_t index, std::span<double> out) const;

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::size_t memory_bytes() const noexcept;
  [[nodiscard]] std::size_t file_bytes() const noexcept;

 private:
  [[nodiscard]] Result<void> open_file();
  [[nodiscard]] Error file_error(const char* what) const;
  [[nodiscard]] std::size_t in_memory() const noexcept { return blocks_.size() * records_per_block_; }

  std::size_t record_size_;
  RecordStorage storage_;
  std::size_t records_per_block_;
  std::vector<std::unique_ptr<double[]>> blocks_;
  std::size_t size_ = 0;
  int file_ = -1;
};

}  // namespace imuscope
