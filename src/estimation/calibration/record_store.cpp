#include "estimation/calibration/record_store.h"

#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "base/contracts.h"
#include "base/output_folder.h"

namespace imuscope {
namespace {

/// Memory is taken in pieces of about this size, so that growing never copies what is there.
constexpr std::size_t kBlockBytes = std::size_t{1} << 20U;
constexpr int kNoFile = -1;
constexpr const char* kRemedy = "make room there, or choose another --out folder";

}  // namespace

RecordStore::RecordStore(std::size_t record_size, RecordStorage storage)
    : record_size_(record_size), storage_(std::move(storage)) {
  IMUSCOPE_EXPECTS(record_size > 0);
  const std::size_t record_bytes = record_size * sizeof(double);
  records_per_block_ =
      std::max<std::size_t>(1, std::min(kBlockBytes, storage_.memory_bytes_max) / record_bytes);
}

RecordStore::~RecordStore() {
  if (file_ != kNoFile) close(file_);
}

RecordStore::RecordStore(RecordStore&& other) noexcept
    : record_size_(other.record_size_),
      storage_(std::move(other.storage_)),
      records_per_block_(other.records_per_block_),
      blocks_(std::move(other.blocks_)),
      size_(std::exchange(other.size_, 0)),
      file_(std::exchange(other.file_, kNoFile)) {}

std::size_t RecordStore::memory_bytes() const noexcept { return in_memory() * record_size_ * sizeof(double); }

std::size_t RecordStore::file_bytes() const noexcept {
  return size_ > in_memory() ? (size_ - in_memory()) * record_size_ * sizeof(double) : 0;
}

Error RecordStore::file_error(const char* what) const {
  return {ErrorKind::kWork,
          std::string("the smoother's history cannot be ") + what + " in " + storage_.folder.string() + ": " +
              std::strerror(errno),
          kRemedy};
}

Result<void> RecordStore::open_file() {
  auto file = OutputFolder::open(storage_.folder).and_then([](const OutputFolder& folder) {
    return folder.scratch_file();
  });
  if (!file) return work_error("the smoother's history cannot be kept: " + file.error().what, kRemedy);
  file_ = file->release();
  return {};
}

Result<void> RecordStore::append(std::span<const double> record) {
  IMUSCOPE_EXPECTS(record.size() == record_size_);
  const std::size_t block_bytes = records_per_block_ * record_size_ * sizeof(double);
  if (size_ == in_memory() && file_ == kNoFile && memory_bytes() + block_bytes <= storage_.memory_bytes_max)
    blocks_.push_back(std::make_unique<double[]>(records_per_block_ * record_size_));
  if (size_ < in_memory()) {
    double* const block = blocks_[size_ / records_per_block_].get();
    std::copy(record.begin(), record.end(), block + (size_ % records_per_block_) * record_size_);
    ++size_;
    return {};
  }
  if (file_ == kNoFile) {
    if (auto opened = open_file(); !opened) return opened;
  }
  const auto bytes = std::as_bytes(record);
  auto offset = static_cast<off_t>((size_ - in_memory()) * bytes.size());
  for (std::size_t written = 0; written < bytes.size();) {
    const ssize_t n = pwrite(file_, bytes.data() + written, bytes.size() - written, offset);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return tl::unexpected<Error>(file_error("written"));
    written += static_cast<std::size_t>(n);
    offset += n;
  }
  ++size_;
  return {};
}

Result<void> RecordStore::read(std::size_t index, std::span<double> out) const {
  IMUSCOPE_EXPECTS(index < size_ && out.size() == record_size_);
  if (index < in_memory()) {
    const double* const record =
        blocks_[index / records_per_block_].get() + (index % records_per_block_) * record_size_;
    std::copy(record, record + record_size_, out.begin());
    return {};
  }
  const auto bytes = std::as_writable_bytes(out);
  auto offset = static_cast<off_t>((index - in_memory()) * bytes.size());
  for (std::size_t have = 0; have < bytes.size();) {
    const ssize_t n = pread(file_, bytes.data() + have, bytes.size() - have, offset);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return tl::unexpected<Error>(file_error("read"));
    have += static_cast<std::size_t>(n);
    offset += n;
  }
  return {};
}

}  // namespace imuscope
