#include "study/row_spool.h"

#include <cerrno>
#include <cstring>
#include <type_traits>

namespace imuscope {

static_assert(std::is_trivially_copyable_v<ErrorRow>);

Result<RowSpool> RowSpool::create(const OutputFolder& folder) {
  auto scratch = folder.scratch_file();
  if (!scratch) return tl::unexpected<Error>(scratch.error());
  std::FILE* file = ::fdopen(scratch->get(), "w+b");
  if (file == nullptr) return work_error(folder.path().string() + ": " + std::strerror(errno));
  (void)scratch->release();
  return RowSpool(file);
}

void RowSpool::add(const ErrorRow& row) noexcept {
  whole_ = std::fwrite(&row, sizeof row, 1, file_.get()) == 1 && whole_;
}

void RowSpool::rewind() {
  whole_ = std::fflush(file_.get()) == 0 && whole_;
  std::rewind(file_.get());
}

bool RowSpool::next(ErrorRow& row) { return std::fread(&row, sizeof row, 1, file_.get()) == 1; }

}  // namespace imuscope
