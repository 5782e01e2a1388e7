#include "base/output_folder.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <utility>

#include "base/contracts.h"

namespace imuscope {
namespace {

constexpr mode_t kFileMode = 0664;
constexpr mode_t kFolderMode = 0775;
/// What a stream of the standard library collects: little is lost when the program is killed.
constexpr std::size_t kBlockBytes = 8192;
constexpr const char* kRemedy = "check the folder's permissions and the disk's free space";

tl::unexpected<Error> refused(const std::filesystem::path& path, int error) {
  return work_error(path.string() + " could not be written: " + std::strerror(error), kRemedy);
}

bool is_component(const std::string& name) {
  return !name.empty() && name != "." && name != ".." && name.find('/') == std::string::npos;
}

/// A name is taken by chance or by somebody who waits for us: then another.
constexpr int kTries = 100;

/// ".NAME.1a2b3c4d"
std::string unfinished_name(const std::string& name, int attempt) {
  std::uint32_t random = 0;
  if (::getrandom(&random, sizeof random, 0) != sizeof random) random = static_cast<std::uint32_t>(attempt);
  std::array<char, 2 * sizeof random + 1> digits{};
  (void)std::snprintf(digits.data(), digits.size(), "%08x", random);
  return "." + name + "." + digits.data();
}

/// Writes everything; 0, or errno.
int write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return n < 0 ? errno : ENOSPC;
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
  return 0;
}

}  // namespace

Descriptor::Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}

Descriptor::~Descriptor() {
  if (fd_ >= 0) ::close(fd_);
}

int Descriptor::release() noexcept { return std::exchange(fd_, -1); }

OutputFile::~OutputFile() { flush(); }

void OutputFile::flush() {
  if (!file_.is_open() || collected_.empty()) return;
  present_error_ = write_all(file_.get(), collected_);
  if (present_error_ == 0) {
    whole_ += collected_.size();
  } else {
    const auto whole = static_cast<off_t>(whole_);
    if (::ftruncate(file_.get(), whole) == 0) (void)::lseek(file_.get(), whole, SEEK_SET);
    lines_lost_ += static_cast<std::size_t>(std::count(collected_.begin(), collected_.end(), '\n'));
    if (error_ == 0) error_ = present_error_;
  }
  collected_.clear();
}

std::optional<Error> OutputFile::problem() const {
  if (present_error_ == 0) return std::nullopt;
  return Error{ErrorKind::kWork, path_.string() + ": lines are lost: " + std::strerror(present_error_),
               "free space on that disk; the file goes on by itself then"};
}

void OutputFile::write(std::string_view lines) {
  collected_ += lines;
  if (collected_.size() >= kBlockBytes) flush();
}

Result<void> OutputFile::close() {
  if (!file_.is_open()) return {};
  flush();
  const int closed = ::close(file_.release()) == 0 ? 0 : errno;
  if (error_ == 0) error_ = closed;
  if (error_ == 0) return {};
  return work_error(path_.string() + " is not whole: " + std::to_string(lines_lost_) +
                        " lines were lost: " + std::strerror(error_),
                    "check the disk's free space");
}

Result<OutputFolder> OutputFolder::open(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder.empty() ? std::filesystem::path(".") : folder;
  std::error_code code;
  std::filesystem::create_directories(path, code);
  if (code) {
    return work_error("folder " + path.string() + " cannot be made: " + code.message(),
                      "choose a folder that this user may write");
  }
  Descriptor opened(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!opened.is_open()) {
    return work_error("folder " + path.string() + " cannot be opened: " + std::strerror(errno),
                      "choose a folder that this user may write");
  }
  return OutputFolder(std::move(opened), path);
}

Result<OutputFolder> OutputFolder::sub_folder(const std::string& name) const {
  IMUSCOPE_EXPECTS(is_component(name));
  const auto path = path_ / name;
  if (::mkdirat(folder_->get(), name.c_str(), kFolderMode) != 0 && errno != EEXIST)
    return refused(path, errno);
  Descriptor opened(::openat(folder_->get(), name.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!opened.is_open()) {
    return work_error(path.string() + " is a link or a file where a folder is to be written to",
                      "look where it came from and remove it");
  }
  return OutputFolder(std::move(opened), path);
}

/// A fresh file; `name` becomes its present name.
Descriptor OutputFolder::begin_unfinished(std::string& name) const {
  IMUSCOPE_EXPECTS(is_component(name));
  const std::string wanted = std::exchange(name, {});
  for (int i = 0; i < kTries; ++i) {
    name = unfinished_name(wanted, i);
    Descriptor file = create_new(name);
    if (file.is_open() || errno != EEXIST) return file;
  }
  return {};
}

Result<void> OutputFolder::rename(const std::string& from, const std::string& to) const {
  if (::renameat(folder_->get(), from.c_str(), folder_->get(), to.c_str()) == 0) return {};
  const int error = errno;
  remove(from);
  return refused(path_ / to, error);
}

Result<OutputFile> OutputFolder::begin(const std::string& name) const {
  std::string unfinished = name;
  Descriptor file = begin_unfinished(unfinished);
  if (!file.is_open()) return refused(path_ / name, errno);
  if (auto renamed = rename(unfinished, name); !renamed) return tl::unexpected<Error>(renamed.error());
  return OutputFile(std::move(file), path_ / name);
}

Result<void> OutputFolder::write_whole(const std::string& name, std::string_view content) const {
  std::string unfinished = name;
  Descriptor file = begin_unfinished(unfinished);
  if (!file.is_open()) return refused(path_ / name, errno);
  int error = write_all(file.get(), content);
  if (::close(file.release()) != 0 && error == 0) error = errno;
  if (error == 0) return rename(unfinished, name);
  remove(unfinished);
  return refused(path_ / name, error);
}

Descriptor OutputFolder::create_new(const std::string& name) const noexcept {
  return Descriptor(
      ::openat(folder_->get(), name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, kFileMode));
}

Result<Descriptor> OutputFolder::scratch_file() const {
  std::string name = "scratch";
  Descriptor file = begin_unfinished(name);
  if (!file.is_open()) return refused(path_ / name, errno);
  // Open until closed, and gone then, also after a crash.
  remove(name);
  return file;
}

Result<OutputFolder> OutputFolder::scratch_folder() const {
  for (int i = 0; i < kTries; ++i) {
    const std::string name = unfinished_name("scratch", i);
    if (::mkdirat(folder_->get(), name.c_str(), kFolderMode) == 0) return sub_folder(name);
    if (errno != EEXIST) return refused(path_ / name, errno);
  }
  return refused(path_, EEXIST);
}

Result<void> OutputFolder::take(const OutputFolder& from, const std::string& name) const {
  IMUSCOPE_EXPECTS(is_component(name));
  if (::renameat(from.descriptor(), name.c_str(), folder_->get(), name.c_str()) == 0) return {};
  return refused(path_ / name, errno);
}

void OutputFolder::remove(const std::string& name) const noexcept {
  IMUSCOPE_EXPECTS(is_component(name));
  if (::unlinkat(folder_->get(), name.c_str(), 0) != 0)
    (void)::unlinkat(folder_->get(), name.c_str(), AT_REMOVEDIR);
}

}  // namespace imuscope
