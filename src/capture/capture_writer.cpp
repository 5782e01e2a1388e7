#include "capture/capture_writer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/contracts.h"
#include "base/output_folder.h"
#include "capture/event_log.h"

namespace imuscope {
namespace {

template <typename Integer>
void put_big_endian(std::vector<std::uint8_t>& out, Integer value) {
  const auto bits = static_cast<std::make_unsigned_t<Integer>>(value);
  for (unsigned shift = sizeof(Integer) * 8; shift > 0; shift -= 8) {
    out.push_back(static_cast<std::uint8_t>(bits >> (shift - 8)));
  }
}

std::string remedy_of(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
      return "free space on that disk; recording goes on by itself then";
    case EACCES:
    case EPERM:
    case EROFS:
      return "choose a folder that this user may write";
    case EEXIST:
      return "choose another name: a capture is never overwritten";
    case EFBIG:
      return "raise the limit on the size of files (ulimit -f), or record on another file system";
    case ENOENT:
      return "leave the folder of a run alone while it is recorded";
    case EIO:
    case ENODEV:
    case ENXIO:
      return "check the disk and its cable";
    default:
      return "check the path and the disk";
  }
}

Error file_error(const std::filesystem::path& path, const std::string& what, int error) {
  return {ErrorKind::kWork, "capture " + path.string() + ": " + what + " (" + std::strerror(error) + ")",
          remedy_of(error)};
}

}  // namespace

Result<CaptureWriter> CaptureWriter::create(const std::filesystem::path& path) {
  const auto folder = OutputFolder::open(path.parent_path());
  if (!folder)
    return work_error("capture " + path.string() + ": " + folder.error().what, folder.error().remedy);
  Descriptor file = folder->create_new(path.filename().string());
  if (!file.is_open()) return tl::unexpected(file_error(path, "cannot be created", errno));
  return CaptureWriter(path, file.release());
}

CaptureWriter::CaptureWriter(CaptureWriter&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      pending_(std::move(other.pending_)),
      pending_records_(std::exchange(other.pending_records_, 0)),
      next_number_(other.next_number_),
      bytes_written_(other.bytes_written_),
      records_written_(other.records_written_),
      records_lost_(other.records_lost_) {}

CaptureWriter::~CaptureWriter() {
  if (file_ >= 0) (void)close();
}

void CaptureWriter::append(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> data) {
  IMUSCOPE_EXPECTS(!channel.empty() && channel.size() < kMaxEventChannelBytes);
  IMUSCOPE_EXPECTS(data.size() <= kMaxEventDataBytes);
  put_big_endian(pending_, kEventLogSync);
  put_big_endian(pending_, next_number_++);
  put_big_endian(pending_, utime);
  put_big_endian(pending_, static_cast<std::int32_t>(channel.size()));
  put_big_endian(pending_, static_cast<std::int32_t>(data.size()));
  pending_.insert(pending_.end(), channel.begin(), channel.end());
  pending_.insert(pending_.end(), data.begin(), data.end());
  pending_records_ += 1;
}

bool CaptureWriter::is_removed() const noexcept {
  struct stat mine {};
  struct stat there {};
  // Some file systems know no count of names, so that a file has none though it is there.
  return ::fstat(file_, &mine) == 0 && mine.st_nlink == 0 &&
         (::stat(path_.c_str(), &there) != 0 || there.st_ino != mine.st_ino || there.st_dev != mine.st_dev);
}

Result<void> CaptureWriter::flush() {
  if (is_removed()) {
    records_lost_ += std::exchange(records_written_, 0);
    bytes_written_ = 0;
    return give_up_pending("was removed while it was recorded", ENOENT);
  }
  std::span<const std::uint8_t> rest(pending_);
  while (!rest.empty()) {
    const ssize_t n = ::write(file_, rest.data(), rest.size());
    if (n < 0) {
      if (errno == EINTR) continue;
      return give_up_pending("records were lost", errno);
    }
    rest = rest.subspan(static_cast<std::size_t>(n));
  }
  bytes_written_ += pending_.size();
  records_written_ += pending_records_;
  pending_.clear();
  pending_records_ = 0;
  return {};
}

Result<void> CaptureWriter::give_up_pending(const char* what, int error) {
  // A part of a record would hide the next one from simple readers. Where even cutting fails, the file is
  // unreachable and the next flush says so again.
  const auto whole = static_cast<off_t>(bytes_written_);
  if (::ftruncate(file_, whole) == 0) (void)::lseek(file_, whole, SEEK_SET);
  records_lost_ += pending_records_;
  pending_.clear();
  pending_records_ = 0;
  return tl::unexpected(file_error(path_, what, error));
}

Result<void> CaptureWriter::close() {
  IMUSCOPE_EXPECTS(file_ >= 0);
  Result<void> result = flush();
  if (::fdatasync(file_) != 0 && result)
    result = tl::unexpected(file_error(path_, "cannot be completed", errno));
  if (::close(std::exchange(file_, -1)) != 0 && result) {
    result = tl::unexpected(file_error(path_, "cannot be closed", errno));
  }
  return result;
}

}  // namespace imuscope
