#include "study/row_spool.h"

#include <cerrno>
#include <cstring>
#include <utility>

namespace imuscope {

namespace {

/// Some thousand records a call of the system: rows of ten hours are some gigabytes, and are read several times.
constexpr std::size_t kBuffer_bytes = std::size_t{1} << 18U;

}  // namespace

Result<ScratchRecords> ScratchRecords::create(const OutputFolder& folder, std::size_t record_bytes) {
  auto scratch = folder.scratch_file();
  if (!scratch) return tl::unexpected<Error>(scratch.error());
  std::FILE* file = ::fdopen(scratch->get(), "w+b");
  if (file == nullptr) return work_error(folder.path().string() + ": " + std::strerror(errno));
  (void)scratch->release();
  // glibc takes a buffer that it is given, and no size without one.
  auto buffer = std::make_unique<char[]>(kBuffer_bytes);
  (void)std::setvbuf(file, buffer.get(), _IOFBF, kBuffer_bytes);
  return ScratchRecords(std::move(buffer), file, record_bytes);
}

void ScratchRecords::add(const void* record) noexcept {
  ++size_;
  whole_ = std::fwrite(record, record_bytes_, 1, file_.get()) == 1 && whole_;
}

void ScratchRecords::rewind() {
  whole_ = std::fflush(file_.get()) == 0 && whole_;
  std::rewind(file_.get());
}

bool ScratchRecords::next(void* record) { return std::fread(record, record_bytes_, 1, file_.get()) == 1; }

}  // namespace imuscope
