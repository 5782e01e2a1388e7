#include "drivers/transport/net_stream.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <linux/sock_diag.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/transport/receive_buffer.h"

namespace imuscope {
namespace {

constexpr int kConnectWithin_ms = 1000;
// A server that vanished without a word is noticed after idle + count * interval.
constexpr int kKeepAliveIdle_s = 5;
constexpr int kKeepAliveInterval_s = 2;
constexpr int kKeepAliveCount = 3;
// Of datagrams: each takes about a kilobyte of kernel memory, so that this is two minutes of a hundred a
// second. Memory is taken by what waits alone.
constexpr int kReceiveBuffer = 1 << 24;

/// Closes what is not handed on.
class Socket {
 public:
  explicit Socket(int fd) noexcept : fd_(fd) {}
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    if (fd_ >= 0) ::close(fd_);
  }
  [[nodiscard]] int fd() const noexcept { return fd_; }
  [[nodiscard]] int release() noexcept { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

struct AddressListDeleter {
  void operator()(addrinfo* list) const noexcept { freeaddrinfo(list); }
};
using AddressList = std::unique_ptr<addrinfo, AddressListDeleter>;

std::string name_of(const NetSettings& settings) {
  const bool tcp = settings.kind == NetSettings::Kind::kTcp;
  return fmt::format("{}://{}:{}", tcp ? "tcp" : "udp", settings.host, settings.port);
}

Result<AddressList> resolve(const NetSettings& settings) {
  const bool tcp = settings.kind == NetSettings::Kind::kTcp;
  addrinfo wanted{};
  wanted.ai_family = AF_UNSPEC;
  wanted.ai_socktype = tcp ? SOCK_STREAM : SOCK_DGRAM;
  wanted.ai_flags = AI_NUMERICSERV | (tcp ? AI_ADDRCONFIG : AI_PASSIVE);
  if (!tcp && settings.host.empty()) wanted.ai_family = AF_INET;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(settings.host.empty() ? nullptr : settings.host.c_str(),
                                std::to_string(settings.port).c_str(), &wanted, &found);
  if (error != 0) {
    return work_error(fmt::format("{}: {}", name_of(settings), gai_strerror(error)),
                      "check the host's name, or give its address");
  }
  return AddressList(found);
}

template <typename T>
void set_option(int fd, int level, int name, const T& value) {
  (void)setsockopt(fd, level, name, &value, sizeof value);
}

/// errno of the failed connection; 0: connected.
int connect_within(int fd, const addrinfo& address) {
  if (connect(fd, address.ai_addr, address.ai_addrlen) == 0) return 0;
  if (errno != EINPROGRESS) return errno;
  pollfd waiting{fd, POLLOUT, 0};
  if (poll(&waiting, 1, kConnectWithin_ms) <= 0) return ETIMEDOUT;
  int error = 0;
  socklen_t size = sizeof error;
  (void)getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
  return error;
}

std::string_view remedy_for_connection(int error) {
  switch (error) {
    case ECONNREFUSED:
      return "start the server there (rtkrcv, str2str, the unit's output), or check the port number";
    case ETIMEDOUT:
    case EHOSTUNREACH:
    case ENETUNREACH:
      return "check the network cable, the address, and that both are in one network";
    default:
      return "check host and port";
  }
}

Result<int> open_tcp(const NetSettings& settings, const addrinfo* addresses) {
  int error = EINVAL;
  for (const addrinfo* address = addresses; address != nullptr; address = address->ai_next) {
    Socket socket(::socket(address->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    error = socket.fd() < 0 ? errno : connect_within(socket.fd(), *address);
    if (error != 0) continue;
    set_option(socket.fd(), IPPROTO_TCP, TCP_NODELAY, 1);
    (void)ask_for_stamps(socket.fd());
    set_option(socket.fd(), SOL_SOCKET, SO_KEEPALIVE, 1);
    set_option(socket.fd(), IPPROTO_TCP, TCP_KEEPIDLE, kKeepAliveIdle_s);
    set_option(socket.fd(), IPPROTO_TCP, TCP_KEEPINTVL, kKeepAliveInterval_s);
    set_option(socket.fd(), IPPROTO_TCP, TCP_KEEPCNT, kKeepAliveCount);
    return socket.release();
  }
  return work_error(fmt::format("{} does not answer ({})", name_of(settings), std::strerror(error)),
                    std::string(remedy_for_connection(error)));
}

bool is_multicast(const addrinfo& address) {
  if (address.ai_family == AF_INET6) {
    sockaddr_in6 in{};
    std::memcpy(&in, address.ai_addr, sizeof in);
    return IN6_IS_ADDR_MULTICAST(&in.sin6_addr);
  }
  sockaddr_in in{};
  std::memcpy(&in, address.ai_addr, sizeof in);
  return IN_MULTICAST(ntohl(in.sin_addr.s_addr));
}

/// On the interface that the routes lead to, or that the address itself names ("ff02::1%eth0").
bool join_group(int fd, const addrinfo& address) {
  const bool is_v6 = address.ai_family == AF_INET6;
  group_req group{};
  std::memcpy(&group.gr_group, address.ai_addr, address.ai_addrlen);
  if (is_v6) {
    sockaddr_in6 in{};
    std::memcpy(&in, address.ai_addr, sizeof in);
    group.gr_interface = in.sin6_scope_id;
  }
  return setsockopt(fd, is_v6 ? IPPROTO_IPV6 : IPPROTO_IP, MCAST_JOIN_GROUP, &group, sizeof group) == 0;
}

/// @param[out] shortage  of memory for datagrams that wait
Result<int> open_udp(const NetSettings& settings, const addrinfo& address, std::string& shortage) {
  Socket socket(::socket(address.ai_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (socket.fd() < 0) return work_error(fmt::format("{}: {}", name_of(settings), std::strerror(errno)));
  shortage = buffer_shortage(grow_receive_buffer(socket.fd(), kReceiveBuffer), kReceiveBuffer);
  (void)ask_for_stamps(socket.fd());
  const bool multicast = is_multicast(address);
  // Several listeners may share a group; a port of our own is ours alone.
  if (multicast) set_option(socket.fd(), SOL_SOCKET, SO_REUSEADDR, 1);
  if (bind(socket.fd(), address.ai_addr, address.ai_addrlen) != 0) {
    const bool taken = errno == EADDRINUSE;
    return work_error(fmt::format("{}: {}", name_of(settings), std::strerror(errno)),
                      taken ? "another program listens there: end it, or choose another port"
                            : "give an address of this PC, a multicast group, or leave host out");
  }
  if (multicast && !join_group(socket.fd(), address)) {
    return work_error(
        fmt::format("{}: the group cannot be joined ({})", name_of(settings), std::strerror(errno)),
        "check that a network interface with a multicast route is up");
  }
  return socket.release();
}

}  // namespace

Result<std::unique_ptr<NetStream>> NetStream::open(const NetSettings& settings) {
  const bool tcp = settings.kind == NetSettings::Kind::kTcp;
  if (settings.port == 0 || (tcp && settings.host.empty())) {
    return usage_error(fmt::format("{} is no network address", name_of(settings)),
                       "give host and port of the server, or the port to listen on");
  }
  const auto addresses = resolve(settings);
  if (!addresses) return tl::unexpected<Error>(addresses.error());
  std::string shortage;
  const auto fd = tcp ? open_tcp(settings, addresses->get()) : open_udp(settings, **addresses, shortage);
  if (!fd) return tl::unexpected<Error>(fd.error());
  return std::unique_ptr<NetStream>(new NetStream(*fd, settings, std::move(shortage)));
}

NetStream::~NetStream() { ::close(fd_); }

namespace {

bool is_of_the_network(int error) noexcept {
  constexpr std::array kPassing{ECONNREFUSED, EHOSTUNREACH, EHOSTDOWN, ENETUNREACH,
                                ENETDOWN,     ETIMEDOUT,    ENOBUFS,   ENOMEM};
  return std::find(kPassing.begin(), kPassing.end(), error) != kPassing.end();
}

}  // namespace

IoResult NetStream::read(std::span<std::uint8_t> buffer) noexcept {
  const bool tcp = settings_.kind == NetSettings::Kind::kTcp;
  // An empty datagram says nothing, and whoever sends them without end must not keep the reader here: what is
  // left waits for the next call.
  constexpr int kAttempts = 16;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    iovec room{buffer.data(), buffer.size()};
    alignas(cmsghdr) std::array<std::uint8_t, kStampControlBytes> control;
    msghdr message{};
    message.msg_iov = &room;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    // With MSG_TRUNC a datagram's whole length comes back, also of what did not fit.
    const ssize_t n = recvmsg(fd_, &message, tcp ? 0 : MSG_TRUNC);
    if (n > 0) {
      const auto size = static_cast<std::size_t>(n);
      const HostTime at = received(message);
      if (tcp) return {IoStatus::kDone, size, size == buffer.size(), at};
      if (size > buffer.size()) ++datagrams_cut_;
      return {IoStatus::kDone, std::min(size, buffer.size()), true, at};
    }
    if (n == 0) {
      if (tcp) return {IoStatus::kGone, 0};
      continue;  // an empty datagram
    }
    if (errno == EINTR) continue;
    if (errno == EAGAIN || errno == EWOULDBLOCK) return {IoStatus::kNothing, 0};
    // What a network says of the far end is said once and passes. Any other error would stay, and come at
    // every turn.
    return {tcp || !is_of_the_network(errno) ? IoStatus::kGone : IoStatus::kNothing, 0};
  }
  return {IoStatus::kNothing, 0};
}

/// Of a read of TCP: when its last byte had come, as the kernel keeps the newest stamp of what it joins.
HostTime NetStream::received(const msghdr& message) noexcept {
  stamps_.begin_read(read_both_clocks());
  return stamps_.map(stamps_of(message));
}

IoResult NetStream::write(std::span<const std::uint8_t> bytes) noexcept {
  if (settings_.kind == NetSettings::Kind::kUdp) return {IoStatus::kNothing, 0};
  for (;;) {
    const ssize_t n = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n >= 0) return {n > 0 ? IoStatus::kDone : IoStatus::kNothing, static_cast<std::size_t>(n)};
    if (errno == EINTR) continue;
    const bool full = errno == EAGAIN || errno == EWOULDBLOCK;
    return {full ? IoStatus::kNothing : IoStatus::kGone, 0};
  }
}

LineHealth NetStream::health() noexcept {
  LineHealth health;
  health.stamps = stamps_.quality();
  if (settings_.kind == NetSettings::Kind::kTcp) return health;
  std::array<std::uint32_t, SK_MEMINFO_VARS> counts{};
  socklen_t size = sizeof counts;
  const bool known = getsockopt(fd_, SOL_SOCKET, SO_MEMINFO, counts.data(), &size) == 0;
  health.frames_dropped = datagrams_cut_ + (known ? counts[SK_MEMINFO_DROPS] : 0);
  return health;
}

std::string NetStream::describe() const {
  return shortage_.empty() ? name_of(settings_) : name_of(settings_) + " (" + shortage_ + ")";
}

}  // namespace imuscope
