#include "publish/lcm_listener.h"

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>
#include <vector>

#include "publish/lcm_datagram.h"
#include "publish/lcm_socket_filter.h"
#include "publish/receive_age.h"

namespace imuscope {

namespace {

constexpr std::string_view kAnyEnding = ".*";

Result<void> refused(const char* what) {
  return work_error(std::string("LCM: the system refuses ") + what + " (" + std::strerror(errno) +
                    "), so nothing is listened to");
}

template <typename Value>
bool set(int socket, int level, int name, const Value& value) {
  return setsockopt(socket, level, name, &value, sizeof value) == 0;
}

/// Hears the bus on the interface that the PC's routes name for it, and nothing before the filter stands.
Result<void> join(int socket, const UdpmBus& bus, Reach reach) {
  if (auto deaf = attach_lcm_filter(socket, {}, reach); !deaf) return deaf;
  const int yes = 1;
  const int no = 0;
  (void)set(socket, SOL_SOCKET, SO_TIMESTAMPNS, yes);  // without it messages are as old as their reading
  if (!set(socket, SOL_SOCKET, SO_REUSEADDR, yes)) return refused("to share the bus with others");
  // Without this a socket hears what any program of this PC has joined, on any interface.
  if (!set(socket, IPPROTO_IP, IP_MULTICAST_ALL, no)) return refused("to hear one interface alone");
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(bus.port);
  address.sin_addr.s_addr =
      htonl(bus.group);  // of the group: what is sent to this PC's own address stays out
  if (bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return refused("the bus's port");
  ip_mreqn membership{};
  membership.imr_multiaddr = address.sin_addr;
  if (!set(socket, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership)) return refused("to join the multicast group");
  return {};
}

std::chrono::nanoseconds since_epoch(const timespec& time) noexcept {
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

std::chrono::nanoseconds now_by(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return since_epoch(now);
}

ReceiveAge::Clocks read_clocks() noexcept { return {now_by(CLOCK_MONOTONIC), now_by(CLOCK_REALTIME)}; }

}  // namespace

struct LcmListener::Impl {
  Impl(int socket_in, Reach reach_in, std::string_view prefix_in)
      : socket(socket_in), reach(reach_in), prefix(prefix_in) {}
  ~Impl() { ::close(socket); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void handle(std::span<const std::uint8_t> datagram) const {
    const auto heard = read_short_message(datagram);
    if (!heard) return;
    for (std::size_t i = 0; i < patterns.size(); ++i) {
      if (patterns[i].matches(heard->channel)) handlers[i](std::string(heard->channel), heard->message);
    }
  }

  /// Bytes of the next datagram; below zero where none waits. Sets its age.
  ssize_t receive() noexcept {
    iovec vector{buffer.data(), buffer.size()};
    alignas(cmsghdr) std::array<std::uint8_t, CMSG_SPACE(sizeof(timespec))> control{};
    msghdr header{};
    header.msg_iov = &vector;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    const ReceiveAge::Clocks before = read_clocks();
    const ssize_t n = recvmsg(socket, &header, 0);
    if (n < 0) receive_age.nothing_waited(before);
    age = {};
    const cmsghdr* const told = n >= 0 ? CMSG_FIRSTHDR(&header) : nullptr;
    if (told == nullptr || told->cmsg_level != SOL_SOCKET || told->cmsg_type != SO_TIMESTAMPNS) return n;
    timespec received{};
    std::memcpy(&received, CMSG_DATA(told), sizeof received);
    age = receive_age.of(since_epoch(received), read_clocks());
    return n;
  }

  int socket;
  Reach reach;
  ReceiveAge receive_age{read_clocks()};
  std::chrono::nanoseconds age{};
  std::string prefix;
  std::vector<ChannelPattern> patterns;
  std::vector<Handler> handlers;  // one a pattern
  std::array<std::uint8_t, kMaxDatagramBytes> buffer{};
};

Result<LcmListener> LcmListener::open(std::string_view url, std::string_view prefix) {
  const auto bus = check_lcm_bus(url);
  if (!bus) return tl::unexpected<Error>(bus.error());
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket < 0) return tl::unexpected<Error>(refused("a socket").error());
  const Reach reach = bus->ttl == 0 ? Reach::kThisPc : Reach::kNetwork;
  auto impl = std::make_unique<Impl>(socket, reach, prefix);
  if (auto joined = join(socket, *bus, reach); !joined) return tl::unexpected<Error>(joined.error());
  return LcmListener(std::move(impl));
}

LcmListener::LcmListener(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
LcmListener::LcmListener(LcmListener&&) noexcept = default;
LcmListener& LcmListener::operator=(LcmListener&&) noexcept = default;
LcmListener::~LcmListener() = default;

Result<void> LcmListener::subscribe(std::string_view kind, Handler handler) {
  ChannelPattern pattern{impl_->prefix + "_", kind.ends_with(kAnyEnding)};
  if (pattern.any_ending) kind.remove_suffix(kAnyEnding.size());
  pattern.text += kind;
  if (pattern.text.size() > kMaxChannelBytes) {
    return usage_error("LCM: the channel " + pattern.text + " has " + std::to_string(pattern.text.size()) +
                           " characters and may have " + std::to_string(kMaxChannelBytes),
                       "choose a shorter prefix");
  }
  auto patterns = impl_->patterns;
  patterns.push_back(std::move(pattern));
  if (auto attached = attach_lcm_filter(impl_->socket, patterns, impl_->reach); !attached) return attached;
  impl_->patterns = std::move(patterns);
  impl_->handlers.push_back(std::move(handler));
  return {};
}

int LcmListener::wait(std::chrono::milliseconds timeout) {
  pollfd input{impl_->socket, POLLIN, 0};
  (void)poll(&input, 1, static_cast<int>(timeout.count()));  // whatever it says, the reading tells
  const auto end = std::chrono::steady_clock::now() + kLongestAtOnce;
  int handled = 0;
  while (handled < kMostAtOnce && std::chrono::steady_clock::now() < end) {
    const auto n = impl_->receive();
    if (n < 0) break;
    impl_->handle({impl_->buffer.data(), static_cast<std::size_t>(n)});
    ++handled;
  }
  return handled;
}

std::chrono::nanoseconds LcmListener::age() const noexcept { return impl_->age; }

}  // namespace imuscope
