#include "service/doors/status_socket.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>

#include "base/output_folder.h"
#include "publish/message_codec.h"
#include "rt/host_clock.h"
#include "rt/thread_setup.h"

namespace imuscope {

namespace {

constexpr std::string_view kSuffix = ".status";
/// A status of eight devices has some ten kilobytes.
constexpr std::size_t kStatusMax = std::size_t{1} << 20U;
constexpr std::size_t kAgeBytes = 8;
constexpr timeval kPatience{2, 0};
constexpr mode_t kOwnerAlone = 0700;
constexpr mode_t kOwnerReadsAndWrites = 0600;
constexpr mode_t kOthersMayWrite = 0022;

std::string reason() { return std::generic_category().message(errno); }

std::string variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

/// Where this process may have its socket; empty where nobody gave it a place.
std::filesystem::path own_directory() {
  // systemd joins several by colons.
  if (const auto of_service = variable("RUNTIME_DIRECTORY"); !of_service.empty())
    return of_service.substr(0, of_service.find(':'));
  if (const auto of_user = variable("XDG_RUNTIME_DIR"); !of_user.empty())
    return std::filesystem::path(of_user) / "imuscope";
  if (geteuid() == 0) return "/run/imuscope";
  return {};
}

Result<sockaddr_un> address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.size() >= sizeof address.sun_path)
    return work_error(fmt::format("{} is too long for a socket", text),
                      "set XDG_RUNTIME_DIR to a shorter path");
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  return address;
}

/// Nobody else may put a socket of his own there.
Result<void> make_private(const std::filesystem::path& directory) {
  if (mkdir(directory.c_str(), kOwnerAlone) != 0 && errno != EEXIST)
    return work_error(fmt::format("{} cannot be made ({})", directory.string(), reason()));
  struct stat found {};
  if (lstat(directory.c_str(), &found) != 0)
    return work_error(fmt::format("{} cannot be looked at ({})", directory.string(), reason()));
  // systemd gives a service of a user of its own a link, which root alone can make.
  if (S_ISLNK(found.st_mode) && (found.st_uid != 0 || stat(directory.c_str(), &found) != 0))
    return work_error(fmt::format("{} is a link of somebody else's", directory.string()), "remove it");
  if (!S_ISDIR(found.st_mode) || found.st_uid != geteuid() || (found.st_mode & kOthersMayWrite) != 0)
    return work_error(fmt::format("{} is not this user's alone", directory.string()),
                      fmt::format("rm -r {0}, or chown and chmod 700 it", directory.string()));
  return {};
}

/// The process of a socket's name; 0 where it is none of ours.
pid_t process_of(const std::filesystem::path& socket) {
  const std::string name = socket.filename().string();
  if (!name.ends_with(kSuffix)) return 0;
  pid_t id = 0;
  const char* const end = name.data() + name.size() - kSuffix.size();
  const auto [stop, error] = std::from_chars(name.data(), end, id);
  return error == std::errc() && stop == end && id > 0 ? id : 0;
}

/// Runs that were killed leave theirs.
void remove_left_behind(const std::filesystem::path& directory) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(directory, ignored)) {
    const auto address = address_of(entry.path());
    if (process_of(entry.path()) == 0 || !address) continue;
    const Descriptor probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (connect(probe.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0 &&
        errno == ECONNREFUSED)
      std::filesystem::remove(entry.path(), ignored);
  }
}

std::vector<std::uint8_t> big_endian(Duration age) {
  std::vector<std::uint8_t> bytes;
  for (int shift = 56; shift >= 0; shift -= 8)
    bytes.push_back(
        static_cast<std::uint8_t>(static_cast<std::uint64_t>(age.count()) >> static_cast<unsigned>(shift)));
  return bytes;
}

bool may_ask(int client) {
  ucred peer{};
  socklen_t size = sizeof peer;
  return getsockopt(client, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
         (peer.uid == 0 || peer.uid == geteuid());
}

}  // namespace

struct StatusSocket::Impl {
  explicit Impl(const StatusBoard& from) : board(from) {}
  ~Impl() {
    if (thread.joinable()) {
      const std::uint64_t one = 1;
      (void)!write(stop.get(), &one, sizeof one);
      thread.join();
    }
    if (listener.is_open()) unlink(path.c_str());
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void serve() const {
    (void)setup_this_thread({kStatusThreadName, Scheduling::kNormal, 0, {}});
    while (true) {
      std::array<pollfd, 2> waits{pollfd{listener.get(), POLLIN, 0}, pollfd{stop.get(), POLLIN, 0}};
      if (poll(waits.data(), waits.size(), -1) < 0 && errno != EINTR) return;
      if (waits[1].revents != 0) return;
      if (waits[0].revents == 0) continue;
      answer(Descriptor(accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC)));
    }
  }

  /// One after the other: an answer fits into what the kernel keeps for a socket, so that nobody is waited
  /// for.
  void answer(const Descriptor& client) const {
    if (!client.is_open()) {
      // Out of descriptors, say: not again at once.
      poll(nullptr, 0, 100);
      return;
    }
    const auto posted = board.newest();
    if (!posted || !may_ask(client.get())) return;
    // Its age first: what made it may stand still.
    std::vector<std::uint8_t> message = big_endian(host_now() - posted->at);
    const auto status = encode_message(posted->status);
    message.insert(message.end(), status.begin(), status.end());
    setsockopt(client.get(), SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
    std::size_t sent = 0;
    while (sent < message.size()) {
      const ssize_t n = send(client.get(), message.data() + sent, message.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) return;
      sent += static_cast<std::size_t>(n);
    }
  }

  const StatusBoard& board;
  std::filesystem::path path;
  Descriptor listener;
  Descriptor stop;
  std::thread thread;
};

StatusSocket::StatusSocket(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
StatusSocket::~StatusSocket() = default;
const std::filesystem::path& StatusSocket::path() const noexcept { return impl_->path; }

Result<std::unique_ptr<StatusSocket>> StatusSocket::open(const StatusBoard& board) {
  const auto directory = own_directory();
  if (directory.empty())
    return work_error("this user has no runtime directory", "set XDG_RUNTIME_DIR, as a login does");
  if (auto made = make_private(directory); !made) return tl::unexpected<Error>(made.error());
  remove_left_behind(directory);
  auto impl = std::make_unique<Impl>(board);
  const auto path = directory / fmt::format("{}{}", getpid(), kSuffix);
  const auto address = address_of(path);
  if (!address) return tl::unexpected<Error>(address.error());
  Descriptor listener(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  constexpr int kWaiting = 8;
  // The mode of the socket becomes that of its name, less the umask: there is no moment at which others could
  // connect.
  if (!listener.is_open() || fchmod(listener.get(), kOwnerReadsAndWrites) != 0 ||
      bind(listener.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0 ||
      listen(listener.get(), kWaiting) != 0)
    return work_error(fmt::format("{} cannot be opened ({})", path.string(), reason()));
  impl->path = path;
  impl->listener = std::move(listener);
  impl->stop = Descriptor(eventfd(0, EFD_CLOEXEC));
  impl->thread = std::thread([raw = impl.get()] { raw->serve(); });
  return std::unique_ptr<StatusSocket>(new StatusSocket(std::move(impl)));
}

Result<std::vector<std::filesystem::path>> find_status_sockets() {
  std::vector<std::filesystem::path> directories{"/run/imuscope"};
  if (const auto own = own_directory(); !own.empty() && own != directories.front())
    directories.push_back(own);
  std::vector<std::filesystem::path> found;
  std::string closed;
  for (const auto& directory : directories) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(directory, error)) {
      if (process_of(entry.path()) > 0) found.push_back(entry.path());
    }
    if (error == std::errc::permission_denied) closed = directory.string();
  }
  if (!found.empty()) {
    std::sort(found.begin(), found.end(),
              [](const auto& a, const auto& b) { return process_of(a) < process_of(b); });
    return found;
  }
  if (!closed.empty())
    return work_error(fmt::format("this user may not look into {}", closed),
                      "ask as root: sudo imuscope status");
  return work_error("no run was found on this PC",
                    "start one: systemctl start imuscope, or imuscope run; a run of another user "
                    "answers that user and root alone");
}

Result<AskedStatus> ask_status(const std::filesystem::path& socket) {
  const auto address = address_of(socket);
  if (!address) return tl::unexpected<Error>(address.error());
  const Descriptor line(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  setsockopt(line.get(), SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  setsockopt(line.get(), SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
  if (connect(line.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0) {
    return work_error(fmt::format("nobody answers at {} ({})", socket.string(), reason()),
                      errno == EACCES ? "ask as root: sudo imuscope status"
                                      : "that run was killed; start one: imuscope run");
  }
  std::vector<std::uint8_t> message;
  std::array<std::uint8_t, 65536> part{};
  ssize_t n = 0;
  while (message.size() < kStatusMax && (n = recv(line.get(), part.data(), part.size(), 0)) > 0)
    message.insert(message.end(), part.begin(), part.begin() + n);
  if (n < 0)
    return work_error(fmt::format("{} does not answer ({})", socket.string(), reason()),
                      "is that run standing still? See its log");
  if (message.size() < kAgeBytes)
    return work_error(fmt::format("{} has no status yet, or none for this user", socket.string()),
                      "ask again in a second, or as root");
  std::uint64_t age_ns = 0;
  for (std::size_t i = 0; i < kAgeBytes; ++i) age_ns = age_ns << 8U | message[i];
  auto status = decode_message<status_t>(std::span(message).subspan(kAgeBytes));
  if (!status)
    return work_error(fmt::format("the run at {} is of another version", socket.string()),
                      "use the imuscope that it was started with, or start it anew");
  return AskedStatus{std::move(*status), to_seconds(Duration{static_cast<std::int64_t>(age_ns)})};
}

}  // namespace imuscope
