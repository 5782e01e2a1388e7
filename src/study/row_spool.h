#pragma once

/// What a pass over the recording makes of its samples, on its way through further passes: kept in a file of
/// the run folder that has no name any more, so that memory does not grow with the drive and nothing is left
/// after.

#include <cstddef>
#include <cstdio>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "models/dynamics/study.h"

namespace imuscope {

/// Records of one size, first written and then read.
class ScratchRecords {
 public:
  ScratchRecords(ScratchRecords&&) noexcept = default;
  // One by one its members would free the buffer of a file that is still open.
  ScratchRecords& operator=(ScratchRecords&&) = delete;
  ~ScratchRecords() = default;
  /// Errors (kWork): no file can be made in `folder`.
  static Result<ScratchRecords> create(const OutputFolder& folder, std::size_t record_bytes);

  void add(const void* record) noexcept;
  /// Records that were added.
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// False once a record could not be kept (disk full): what is read then is not the whole.
  [[nodiscard]] bool whole() const noexcept { return whole_; }
  /// To the first; from here on they are read.
  void rewind();
  /// False at the end.
  bool next(void* record);

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { (void)std::fclose(file); }
  };
  ScratchRecords(std::unique_ptr<char[]> buffer, std::FILE* file, std::size_t record_bytes)
      : buffer_(std::move(buffer)), file_(file), record_bytes_(record_bytes) {}

  std::unique_ptr<char[]> buffer_;  ///< the file's
  std::unique_ptr<std::FILE, Close> file_;
  std::size_t record_bytes_;
  std::size_t size_ = 0;
  bool whole_ = true;
};

/// Records of one type.
template <typename Record>
class Spool {
 public:
  static_assert(std::is_trivially_copyable_v<Record>);
  static Result<Spool> create(const OutputFolder& folder) {
    return ScratchRecords::create(folder, sizeof(Record)).map([](ScratchRecords&& records) {
      return Spool(std::move(records));
    });
  }
  void add(const Record& record) noexcept { records_.add(&record); }
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }
  [[nodiscard]] bool whole() const noexcept { return records_.whole(); }
  void rewind() { records_.rewind(); }
  bool next(Record& record) { return records_.next(&record); }

 private:
  explicit Spool(ScratchRecords records) : records_(std::move(records)) {}
  ScratchRecords records_;
};

/// Error rows of one S-IMU.
class RowSpool final : public ErrorRowSource {
 public:
  /// Errors (kWork): no file can be made in `folder`.
  static Result<RowSpool> create(const OutputFolder& folder) {
    return Spool<ErrorRow>::create(folder).map(
        [](Spool<ErrorRow>&& rows) { return RowSpool(std::move(rows)); });
  }

  void add(const ErrorRow& row) noexcept { rows_.add(row); }
  [[nodiscard]] std::size_t size() const noexcept { return rows_.size(); }
  [[nodiscard]] bool whole() const noexcept { return rows_.whole(); }
  void rewind() override { rows_.rewind(); }
  bool next(ErrorRow& row) override { return rows_.next(row); }

 private:
  explicit RowSpool(Spool<ErrorRow> rows) : rows_(std::move(rows)) {}
  Spool<ErrorRow> rows_;
};

/// The next records, about a megabyte of them; false after the last.
template <typename Record, typename Records>
bool read_block(std::vector<Record>& block, Records& records) {
  constexpr std::size_t kBlock = 2048;
  block.clear();
  for (Record next{}; block.size() < kBlock && records.next(next);) block.push_back(next);
  return !block.empty();
}

}  // namespace imuscope
