#include "service/row_spool.h"

#include <cerrno>
#include <cstring>
#include <type_traits>

namespace imuscope {

static_assert(std::is_trivially_copyable_v<ErrorRow>);

Result<RowSpool> RowSpool::create(const std::filesystem::path& folder) {
  const auto path = folder / ".error_rows";
  std::FILE* file = std::fopen(path.c_str(), "w+b");
  if (file == nullptr) {
    return work_error(path.string() + " could not be made: " + std::strerror(errno),
                      "check the folder's permissions and the disk's free space");
  }
  // Open until closed, and gone then, also after a crash.
  std::error_code nothing_to_be_done;
  std::filesystem::remove(path, nothing_to_be_done);
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
