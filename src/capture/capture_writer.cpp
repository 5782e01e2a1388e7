#include "capture/capture_writer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "base/contracts.h"
#include "base/output_folder.h"
#include "capture/event_log.h"

namespace imuscope {
namespace {

/// At least one seal in so many bytes: readers wait for it.
constexpr std::size_t kSealBytes = std::size_t{32} << 10U;

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

/// The names of a new file and of its folder, which may be new, too. A file system that keeps them anyhow may
/// refuse.
void sync_names(int folder) {
  (void)::fsync(folder);
  const Descriptor parent(::openat(folder, "..", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (parent.is_open()) (void)::fsync(parent.get());
}

}  // namespace

Result<CaptureWriter> CaptureWriter::create(const std::filesystem::path& path,
                                            std::string_view channel_prefix, int file_number) {
  const auto folder = OutputFolder::open(path.parent_path());
  if (!folder)
    return work_error("capture " + path.string() + ": " + folder.error().what, folder.error().remedy);
  Descriptor file = folder->create_new(path.filename().string());
  if (!file.is_open()) return tl::unexpected(file_error(path, "cannot be created", errno));
  CaptureWriter writer(path, file.release(), *folder);
  writer.seal_channel_ = channel_name(channel_prefix, kSealKind);
  writer.index_channel_ = channel_name(channel_prefix, kIndexKind);
  writer.file_number_ = file_number;
  return writer;
}

CaptureWriter::CaptureWriter(CaptureWriter&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      folder_(std::move(other.folder_)),
      seal_channel_(std::move(other.seal_channel_)),
      index_channel_(std::move(other.index_channel_)),
      file_number_(other.file_number_),
      name_is_safe_(other.name_is_safe_),
      sealer_(std::move(other.sealer_)),
      records_synced_(other.records_synced_),
      pending_(std::move(other.pending_)),
      unsealed_bytes_(other.unsealed_bytes_),
      pending_records_(std::exchange(other.pending_records_, 0)),
      pending_begin_(other.pending_begin_),
      next_number_(other.next_number_),
      bytes_written_(other.bytes_written_),
      records_written_(other.records_written_),
      records_lost_(other.records_lost_) {}

CaptureWriter::~CaptureWriter() {
  if (file_ >= 0) (void)close();
}

void CaptureWriter::append(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> data) {
  const std::size_t begin = pending_.size();
  const std::int64_t number = next_number_;
  put(channel, utime, data);
  sealer_.add(number, utime, std::span(pending_).subspan(begin));
  pending_records_ += 1;
  // The header alone, so that a reader knows from the first seal on what kind of log it has.
  unsealed_bytes_ += pending_.size() - begin;
  if (number == 0 || unsealed_bytes_ > kSealBytes) seal();
}

void CaptureWriter::seal() {
  if (sealer_.has_unsealed()) put(seal_channel_, sealer_.utime(), sealer_.seal());
  unsealed_bytes_ = 0;
}

void CaptureWriter::put(std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> data) {
  IMUSCOPE_EXPECTS(!channel.empty() && channel.size() < kMaxEventChannelBytes);
  IMUSCOPE_EXPECTS(data.size() <= kMaxEventDataBytes);
  append_record_head(pending_, next_number_++, utime, channel, data.size());
  pending_.insert(pending_.end(), data.begin(), data.end());
}

bool CaptureWriter::is_removed() const noexcept {
  struct stat mine {};
  struct stat there {};
  // Some file systems know no count of names, so that a file has none though it is there.
  return ::fstat(file_, &mine) == 0 && mine.st_nlink == 0 &&
         (::stat(path_.c_str(), &there) != 0 || there.st_ino != mine.st_ino || there.st_dev != mine.st_dev);
}

Result<void> CaptureWriter::flush() {
  seal();
  return write_pending();
}

Result<void> CaptureWriter::write_pending() {
  if (is_removed()) {
    records_lost_ += std::exchange(records_written_, 0);
    records_synced_ = 0;
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
  sealer_.written(pending_, static_cast<std::uint64_t>(next_number_ - pending_begin_));
  drop_pending();
  return {};
}

Result<void> CaptureWriter::give_up_pending(const char* what, int error) {
  // A part of a record would hide the next one from simple readers. Where even cutting fails, the file is
  // unreachable and the next flush says so again.
  const auto whole = static_cast<off_t>(bytes_written_);
  if (::ftruncate(file_, whole) == 0) (void)::lseek(file_, whole, SEEK_SET);
  records_lost_ += pending_records_;
  drop_pending();
  return tl::unexpected(file_error(path_, what, error));
}

void CaptureWriter::drop_pending() noexcept {
  pending_.clear();
  pending_records_ = 0;
  pending_begin_ = next_number_;
}

Result<void> CaptureWriter::sync() {
  // A pipe or the like has nothing that could be lost.
  if (::fdatasync(file_) != 0 && errno != EINVAL) {
    const int error = errno;
    const std::uint64_t unsure = records_written_ - records_synced_;
    return tl::unexpected(
        file_error(path_, "up to " + std::to_string(unsure) + " records cannot be completed", error));
  }
  records_synced_ = records_written_;
  if (!name_is_safe_) sync_names(folder_.descriptor());
  name_is_safe_ = true;
  return {};
}

Result<void> CaptureWriter::close() {
  IMUSCOPE_EXPECTS(file_ >= 0);
  Result<void> result = flush();
  if (result && bytes_written_ > 0) {
    put(index_channel_, sealer_.utime(), sealer_.index(file_number_));
    result = write_pending();
  }
  if (auto synced = sync(); !synced && result) result = synced;
  if (::close(std::exchange(file_, -1)) != 0 && result) {
    result = tl::unexpected(file_error(path_, "cannot be closed", errno));
  }
  return result;
}

}  // namespace imuscope
