#include "firmware_sim/io/pseudo_terminal.h"

// termios2 (any baud rate) comes from the kernel's header, which does not go together with <termios.h>.
#include <asm/termbits.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

namespace imusim {
namespace {

/// Makes missing folders for their owner alone.
std::error_code make_private_folders(const std::filesystem::path& folder) {
  std::error_code error;
  if (folder.empty() || std::filesystem::exists(folder, error)) return {};
  if (const std::error_code above = make_private_folders(folder.parent_path())) return above;
  constexpr mode_t kOwnerOnly = 0700;
  if (::mkdir(folder.c_str(), kOwnerOnly) != 0 && errno != EEXIST) return {errno, std::system_category()};
  return {};
}

/// Why somebody else could put his own file where the link to the port is to stand; empty where nobody can.
/// As of every folder on the way a stranger could exchange the next one, all of them are asked (sshd does the
/// same for its keys).
std::string who_else_writes(const std::filesystem::path& folder) {
  std::error_code error;
  const auto whole = std::filesystem::absolute(folder.empty() ? "." : folder, error);
  std::filesystem::path above;
  for (const auto& part : whole.lexically_normal()) {
    above /= part;
    struct stat link {};
    struct stat facts {};
    if (::lstat(above.c_str(), &link) != 0 || ::stat(above.c_str(), &facts) != 0) return {};  // not there yet
    const auto foreign = [](const struct stat& found) {
      return found.st_uid != 0 && found.st_uid != ::geteuid();
    };
    if (foreign(link) || foreign(facts)) return fmt::format("{} belongs to somebody else", above.string());
    if ((facts.st_mode & S_IWOTH) != 0 && (facts.st_mode & S_ISVTX) == 0)
      return fmt::format("everybody may write in {}", above.string());
  }
  return {};
}

/// Opens the far end once and closes it: from then on the near end tells whether somebody has it open. Sets
/// it raw, so that nothing is echoed to the device before the program has set it up itself.
bool prepare_far_end(const char* terminal, int baud) {
  const int far_end = ::open(terminal, O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (far_end < 0) return false;
  termios2 settings{};
  settings.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
  settings.c_ispeed = static_cast<speed_t>(baud);
  settings.c_ospeed = static_cast<speed_t>(baud);
  settings.c_cc[VMIN] = 1;
  const bool set = ::ioctl(far_end, TCSETS2, &settings) == 0;
  ::close(far_end);
  return set;
}

/// Puts the link in place in one step, so that no program ever finds half of it.
std::error_code replace_link(const std::string& target, const std::filesystem::path& link) {
  std::error_code error;
  const auto status = std::filesystem::symlink_status(link, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_symlink(status))
    return std::make_error_code(std::errc::file_exists);
  const std::filesystem::path temporary = link.string() + fmt::format(".{}", ::getpid());
  std::filesystem::remove(temporary, error);
  std::filesystem::create_symlink(target, temporary, error);
  if (error) return error;
  std::filesystem::rename(temporary, link, error);
  return error;
}

}  // namespace

tl::expected<PseudoTerminal, std::string> PseudoTerminal::open(const std::filesystem::path& link, int baud) {
  if (const std::error_code error = make_private_folders(link.parent_path()))
    return tl::unexpected(
        fmt::format("cannot make the folder {}: {}", link.parent_path().string(), error.message()));
  if (const std::string danger = who_else_writes(link.parent_path()); !danger.empty()) {
    return tl::unexpected(
        fmt::format("cannot put a port at {}: {}, and could put another one in its "
                    "place; name a folder of your own",
                    link.string(), danger));
  }
  const int near_end = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  constexpr std::size_t kNameSize = 64;
  std::array<char, kNameSize> name{};
  if (near_end < 0 || ::grantpt(near_end) != 0 || ::unlockpt(near_end) != 0 ||
      ::ptsname_r(near_end, name.data(), name.size()) != 0 || !prepare_far_end(name.data(), baud)) {
    const int cause = errno;
    if (near_end >= 0) ::close(near_end);
    return tl::unexpected(fmt::format("cannot open a pseudo-terminal: {}", std::strerror(cause)));
  }
  if (const std::error_code error = replace_link(name.data(), link)) {
    ::close(near_end);
    return tl::unexpected(
        fmt::format("cannot put a link to {} at {}: {}", name.data(), link.string(), error.message()));
  }
  return PseudoTerminal(near_end, name.data(), link);
}

PseudoTerminal::PseudoTerminal(PseudoTerminal&& other) noexcept
    : LineEnd(std::move(other)),
      near_end_(std::exchange(other.near_end_, -1)),
      waiting_(std::move(other.waiting_)),
      terminal_(std::move(other.terminal_)),
      link_(std::move(other.link_)) {}

PseudoTerminal::~PseudoTerminal() {
  if (near_end_ < 0) return;
  ::close(near_end_);
  std::error_code error;
  if (std::filesystem::read_symlink(link_, error) == terminal_) std::filesystem::remove(link_, error);
}

int PseudoTerminal::baud() const {
  termios2 settings{};
  return ::ioctl(near_end_, TCGETS2, &settings) == 0 ? static_cast<int>(settings.c_ospeed) : 0;
}

bool PseudoTerminal::is_open_elsewhere() const {
  pollfd state{near_end_, POLLOUT, 0};
  return ::poll(&state, 1, 0) >= 0 && (state.revents & POLLHUP) == 0;
}

void PseudoTerminal::push_waiting() {
  if (waiting_.empty() || !is_open_elsewhere()) return;
  const ssize_t written = ::write(near_end_, waiting_.data(), waiting_.size());
  if (written > 0) waiting_.erase(waiting_.begin(), waiting_.begin() + written);
}

std::size_t PseudoTerminal::write(std::span<const std::uint8_t> bytes) {
  if (!is_open_elsewhere()) {
    const std::size_t dropped = waiting_.size() + bytes.size();
    waiting_.clear();
    return dropped;
  }
  const std::size_t kept = std::min(bytes.size(), kWaitingMax - waiting_.size());
  waiting_.insert(waiting_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(kept));
  push_waiting();
  return bytes.size() - kept;
}

Bytes PseudoTerminal::read() {
  constexpr std::size_t kChunk = 1024;
  push_waiting();
  Bytes result;
  std::array<std::uint8_t, kChunk> chunk{};
  while (true) {
    const ssize_t count = ::read(near_end_, chunk.data(), chunk.size());
    if (count <= 0) return result;
    result.insert(result.end(), chunk.begin(), chunk.begin() + count);
  }
}

}  // namespace imusim
