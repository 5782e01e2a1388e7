#include "drivers/transport/net_stream.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/support/child_process.h"
#include "tests/support/refused_calls.h"

namespace imuscope {
namespace {

using NetKind = NetSettings::Kind;

sockaddr_in local(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

/// A TCP server or a UDP sender at the far end.
class FarEnd {
 public:
  explicit FarEnd(int type, std::uint16_t port = 0) : fd_(::socket(AF_INET, type, 0)) {
    const int on = 1;
    setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in address = local(port);
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    socklen_t size = sizeof address;
    getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    if (type == SOCK_STREAM) {
      EXPECT_EQ(listen(fd_, 1), 0);
    }
  }
  FarEnd(const FarEnd&) = delete;
  FarEnd& operator=(const FarEnd&) = delete;
  ~FarEnd() {
    if (peer_ >= 0) ::close(peer_);
    ::close(fd_);
  }

  void accept_one() { peer_ = accept(fd_, nullptr, nullptr); }
  void hang_up() { ::close(std::exchange(peer_, -1)); }
  /// Hangs up without waiting for what is under way.
  void reset() {
    const linger at_once{1, 0};
    setsockopt(peer_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    hang_up();
  }
  void say(std::string_view text) const {
    EXPECT_EQ(send(peer_, text.data(), text.size(), 0), ssize_t(text.size()));
  }
  void say_to(std::uint16_t port, std::string_view text) const {
    const sockaddr_in to = local(port);
    EXPECT_EQ(sendto(fd_, text.data(), text.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to),
              ssize_t(text.size()));
  }
  [[nodiscard]] std::string hear() const {
    std::array<char, 100> text{};
    const ssize_t n = recv(peer_, text.data(), text.size(), 0);
    return {text.data(), n > 0 ? static_cast<std::size_t>(n) : 0};
  }
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  int fd_;
  int peer_ = -1;
  std::uint16_t port_ = 0;
};

struct Heard {
  IoStatus status;
  std::string text;
};

/// Waits until there is something, as the service does.
Heard hear(NetStream& stream, std::size_t buffer_size = 100) {
  pollfd waiting{stream.fd(), POLLIN, 0};
  EXPECT_EQ(poll(&waiting, 1, 5000), 1);
  std::vector<std::uint8_t> buffer(buffer_size);
  const IoResult result = stream.read(buffer);
  return {result.status, {buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(result.n)}};
}

TEST(NetStream, ATcpClientReadsAndWritesAndSeesTheServerGo) {
  FarEnd server(SOCK_STREAM);
  auto stream = NetStream::open({NetKind::kTcp, "127.0.0.1", server.port()});
  ASSERT_TRUE(stream) << stream.error().text();
  server.accept_one();
  std::array<std::uint8_t, 10> buffer{};
  EXPECT_EQ((*stream)->read(buffer).status, IoStatus::kNothing);
  server.say("hello");
  EXPECT_EQ(hear(**stream).text, "hello");
  const std::array<std::uint8_t, 3> command{'d', 'm', '\n'};
  EXPECT_EQ((*stream)->write(command).n, 3U);
  EXPECT_EQ(server.hear(), "dm\n");
  server.hang_up();
  EXPECT_EQ(hear(**stream).status, IoStatus::kGone);
}

/// "localhost"; a bare system knows no name at all.
std::string own_name() {
  addrinfo* found = nullptr;
  const bool known = getaddrinfo("localhost", nullptr, nullptr, &found) == 0;
  if (known) freeaddrinfo(found);
  return known ? "localhost" : "127.0.0.1";
}

TEST(NetStream, AServerThatComesBackIsReachedAgain) {
  std::uint16_t port = 0;
  {
    FarEnd server(SOCK_STREAM);
    port = server.port();
    auto stream = NetStream::open({NetKind::kTcp, "127.0.0.1", port});
    ASSERT_TRUE(stream);
    server.accept_one();
  }
  const auto refused = NetStream::open({NetKind::kTcp, "127.0.0.1", port});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("start the server there"), std::string::npos)
      << refused.error().text();
  FarEnd again(SOCK_STREAM, port);
  auto stream = NetStream::open({NetKind::kTcp, own_name(), port});
  ASSERT_TRUE(stream) << stream.error().text();
  again.accept_one();
  again.say("again");
  EXPECT_EQ(hear(**stream).text, "again");
}

TEST(NetStream, DatagramsAreReadOneByOneAndCutOnesAreCounted) {
  FarEnd sender(SOCK_DGRAM);
  // A port that is free: one that was just given out and closed.
  const std::uint16_t port = FarEnd(SOCK_DGRAM).port();
  auto stream = NetStream::open({NetKind::kUdp, "", port});
  ASSERT_TRUE(stream) << stream.error().text();
  sender.say_to(port, "first");
  sender.say_to(port, "second");
  sender.say_to(port, "much too long");
  EXPECT_EQ(hear(**stream).text, "first");
  EXPECT_EQ(hear(**stream).text, "second");
  EXPECT_EQ(hear(**stream, 4).text, "much");
  EXPECT_EQ((*stream)->health().frames_dropped, 1U);
  std::array<std::uint8_t, 10> buffer{};
  EXPECT_EQ((*stream)->read(buffer).status, IoStatus::kNothing);
}

TEST(NetStream, DatagramsThatTheKernelHadNoRoomForAreCounted) {
  FarEnd sender(SOCK_DGRAM);
  const std::uint16_t port = FarEnd(SOCK_DGRAM).port();
  auto stream = NetStream::open({NetKind::kUdp, "127.0.0.1", port});
  ASSERT_TRUE(stream) << stream.error().text();
  const int small = 1;
  ASSERT_EQ(setsockopt((*stream)->fd(), SOL_SOCKET, SO_RCVBUF, &small, sizeof small), 0);
  for (int i = 0; i < 100; ++i) sender.say_to(port, std::string(1000, 'x'));
  int heard = 0;
  std::array<std::uint8_t, 2000> buffer{};
  while ((*stream)->read(buffer).status == IoStatus::kDone) ++heard;
  EXPECT_LT(heard, 100);
  EXPECT_EQ((*stream)->health().frames_dropped, static_cast<std::uint64_t>(100 - heard));
}

TEST(NetStream, SaysWhatIsWrongAndWhatToDo) {
  EXPECT_EQ(NetStream::open({NetKind::kTcp, "", 8000}).error().kind, ErrorKind::kUsage);
  const auto unknown = NetStream::open({NetKind::kTcp, "no.such.host.invalid", 8000});
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().text().find("no.such.host.invalid"), std::string::npos);
  const std::uint16_t port = FarEnd(SOCK_DGRAM).port();
  const auto first = NetStream::open({NetKind::kUdp, "", port});
  ASSERT_TRUE(first);
  const auto second = NetStream::open({NetKind::kUdp, "", port});
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text().find("another program listens there"), std::string::npos);
}

TEST(NetStream, ADatagramWithoutBytesIsPassedOverAndWhatIsSaidToASenderGoesNowhere) {
  FarEnd sender(SOCK_DGRAM);
  const std::uint16_t port = FarEnd(SOCK_DGRAM).port();
  auto stream = NetStream::open({NetKind::kUdp, "127.0.0.1", port});
  ASSERT_TRUE(stream) << stream.error().text();
  sender.say_to(port, "");
  sender.say_to(port, "after");
  sender.say_to(port, "");
  EXPECT_EQ(hear(**stream).text, "after");
  std::array<std::uint8_t, 10> buffer{};
  EXPECT_EQ((*stream)->read(buffer).status, IoStatus::kNothing);
  EXPECT_EQ((*stream)->write(buffer).status, IoStatus::kNothing);
  EXPECT_EQ((*stream)->health().frames_dropped, 0U);
  // After it stands what the system does not grant.
  EXPECT_EQ((*stream)->describe().rfind("udp://127.0.0.1:" + std::to_string(port), 0), 0U);
}

TEST(NetStream, DatagramsWithoutBytesHoldNobody) {
  FarEnd sender(SOCK_DGRAM);
  const std::uint16_t port = FarEnd(SOCK_DGRAM).port();
  auto stream = NetStream::open({NetKind::kUdp, "127.0.0.1", port});
  ASSERT_TRUE(stream) << stream.error().text();
  for (int i = 0; i < 100; ++i) sender.say_to(port, "");
  sender.say_to(port, "after");
  std::array<std::uint8_t, 10> buffer{};
  int calls = 0;
  while ((*stream)->read(buffer).status == IoStatus::kNothing) ASSERT_LT(++calls, 100);
  EXPECT_GT(calls, 1) << "a stream of them must not keep the reader in one call";
}

TEST(NetStream, AServerThatResetsTheConnectionIsGone) {
  for (const bool by_reading : {true, false}) {
    FarEnd server(SOCK_STREAM);
    auto stream = NetStream::open({NetKind::kTcp, "127.0.0.1", server.port()});
    ASSERT_TRUE(stream) << stream.error().text();
    EXPECT_TRUE((*stream)->health().is_up);
    EXPECT_EQ((*stream)->health().frames_dropped, 0U);
    EXPECT_EQ((*stream)->describe(), "tcp://127.0.0.1:" + std::to_string(server.port()));
    server.accept_one();
    server.reset();
    pollfd waiting{(*stream)->fd(), POLLIN, 0};
    ASSERT_EQ(poll(&waiting, 1, 5000), 1);
    std::array<std::uint8_t, 10> buffer{};
    if (by_reading) {
      EXPECT_EQ((*stream)->read(buffer).status, IoStatus::kGone);
    }
    EXPECT_EQ((*stream)->write(buffer).status, IoStatus::kGone) << "and no signal ends the program";
  }
}

TEST(NetStream, AServerThatDoesNotReadMakesNobodyWait) {
  FarEnd server(SOCK_STREAM);
  auto stream = NetStream::open({NetKind::kTcp, "127.0.0.1", server.port()});
  ASSERT_TRUE(stream);
  server.accept_one();
  const std::vector<std::uint8_t> much(100'000, 'x');
  std::size_t sent = 0;
  IoResult last;
  for (int i = 0; i < 10'000; ++i) {
    last = (*stream)->write(much);
    if (last.status != IoStatus::kDone) break;
    sent += last.n;
  }
  EXPECT_EQ(last.status, IoStatus::kNothing);
  std::size_t heard = 0;
  while (heard < sent) heard += server.hear().size();
  EXPECT_EQ(heard, sent) << "what was said to be sent arrives";
  EXPECT_EQ((*stream)->write({}).status, IoStatus::kNothing);
}

TEST(NetStream, ASignalIsNoEndAndAnErrorIsOneOfAConnectionAlone) {
  FarEnd server(SOCK_STREAM);
  auto tcp = NetStream::open({NetKind::kTcp, "127.0.0.1", server.port()});
  ASSERT_TRUE(tcp);
  server.accept_one();
  FarEnd sender(SOCK_DGRAM);
  const std::uint16_t port = FarEnd(SOCK_DGRAM).port();
  auto udp = NetStream::open({NetKind::kUdp, "", port});
  ASSERT_TRUE(udp);
  std::array<std::uint8_t, 10> buffer{};
  {
    const test::RefusedCalls interrupted(test::Call::kRecv, EINTR, 2);
    EXPECT_EQ((*tcp)->read(buffer).status, IoStatus::kNothing);
    EXPECT_EQ(interrupted.left(), 0);
  }
  {
    const test::RefusedCalls interrupted(test::Call::kSend, EINTR, 2);
    EXPECT_EQ((*tcp)->write(buffer).n, buffer.size());
    EXPECT_EQ(interrupted.left(), 0);
  }
  for (const int error : {ETIMEDOUT, EHOSTUNREACH, ENETDOWN}) {
    const test::RefusedCalls refused(test::Call::kRecv, error, 2);
    EXPECT_EQ((*tcp)->read(buffer).status, IoStatus::kGone) << std::strerror(error);
    EXPECT_EQ((*udp)->read(buffer).status, IoStatus::kNothing) << std::strerror(error);
  }
  sender.say_to(port, "still here");
  EXPECT_EQ(hear(**udp).text, "still here");
  // What would come at every turn for ever must not keep the reader turning.
  for (const int error : {ENOSYS, EBADF, ENOTCONN}) {
    const test::RefusedCalls refused(test::Call::kRecv, error, 1);
    EXPECT_EQ((*udp)->read(buffer).status, IoStatus::kGone) << std::strerror(error);
  }
}

TEST(NetStream, AServerThatDoesNotAnswerWithinASecondIsToldWithWhatMayBeTheReason) {
  // A queue of connections that nobody accepts: what does not fit in gets no answer.
  FarEnd server(SOCK_STREAM);
  std::vector<std::unique_ptr<NetStream>> queue;
  Result<std::unique_ptr<NetStream>> last = tl::unexpected<Error>(Error{});
  for (int i = 0; i < 10; ++i) {
    last = NetStream::open({NetKind::kTcp, "127.0.0.1", server.port()});
    if (!last) break;
    queue.push_back(std::move(*last));
  }
  ASSERT_FALSE(last);
  EXPECT_NE(last.error().text().find(std::strerror(ETIMEDOUT)), std::string::npos) << last.error().text();
  EXPECT_NE(last.error().remedy.find("network cable"), std::string::npos);
}

TEST(NetStream, AServerThatLostItsPowerIsFoundOutWithinSeconds) {
  // It says nothing more, not even that it is gone: the kernel has to ask it.
  FarEnd server(SOCK_STREAM);
  auto stream = NetStream::open({NetKind::kTcp, "127.0.0.1", server.port()});
  ASSERT_TRUE(stream) << stream.error().text();
  const auto option = [&](int level, int name) {
    int value = 0;
    socklen_t size = sizeof value;
    EXPECT_EQ(getsockopt((*stream)->fd(), level, name, &value, &size), 0);
    return value;
  };
  EXPECT_NE(option(SOL_SOCKET, SO_KEEPALIVE), 0);
  const int found_out_s = option(IPPROTO_TCP, TCP_KEEPIDLE) +
                          option(IPPROTO_TCP, TCP_KEEPINTVL) * option(IPPROTO_TCP, TCP_KEEPCNT);
  EXPECT_EQ(found_out_s, 11);
  EXPECT_NE(option(IPPROTO_TCP, TCP_NODELAY), 0) << "a command waits for no other";
}

TEST(NetStream, AnAddressOfAnotherPcCannotBeListenedTo) {
  // Of the range that is kept for examples.
  const auto other = NetStream::open({NetKind::kUdp, "192.0.2.1", 9000});
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().remedy.find("give an address of this PC"), std::string::npos)
      << other.error().text();
}

TEST(NetStream, OnAPcWithoutNetworkTheCableIsMeantAndNotTheName) {
  const int outcome = test::in_child([] {
    if (unshare(CLONE_NEWNET) != 0) return test::kNotPermitted;
    const auto stream = NetStream::open({NetKind::kTcp, "192.0.2.1", 9000});
    if (stream) return 1;
    if (stream.error().text().find(std::strerror(ENETUNREACH)) == std::string::npos) return 2;
    return stream.error().remedy.find("network cable") != std::string::npos ? 0 : 3;
  });
  if (outcome == test::kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0);
}

/// A network of this child alone, whose loopback interface carries groups.
bool have_own_network() {
  return unshare(CLONE_NEWNET) == 0 && std::system("ip link set lo up multicast on") == 0 &&
         std::system("ip route add 224.0.0.0/4 dev lo") == 0;
}

/// A datagram to `group` is heard by each of two streams that listen to it.
template <typename Address>
int hear_group(const std::string& group, const Address& to) {
  const auto* const address = reinterpret_cast<const sockaddr*>(&to);
  auto one = NetStream::open({NetKind::kUdp, group, 9000});
  if (!one) return 1;
  auto other = NetStream::open({NetKind::kUdp, group, 9000});
  if (!other) return 2;
  const int sender = ::socket(address->sa_family, SOCK_DGRAM, 0);
  if (sendto(sender, "all", 3, 0, address, sizeof to) != 3) return 3;
  for (const auto* stream : {&*one, &*other}) {
    pollfd waiting{(*stream)->fd(), POLLIN, 0};
    if (poll(&waiting, 1, 2000) != 1) return 4;
    std::array<std::uint8_t, 10> buffer{};
    if ((*stream)->read(buffer).n != 3) return 5;
  }
  return 0;
}

TEST(NetStream, AGroupIsJoinedAndMayHaveSeveralListeners) {
  const int outcome = test::in_child([] {
    if (!have_own_network()) return test::kNotPermitted;
    sockaddr_in group{};
    group.sin_family = AF_INET;
    group.sin_port = htons(9000);
    inet_pton(AF_INET, "239.1.2.3", &group.sin_addr);
    return hear_group("239.1.2.3", group);
  });
  if (outcome == test::kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0);
}

TEST(NetStream, AGroupOfTheNewerProtocolIsJoinedLikewise) {
  const int outcome = test::in_child([] {
    // The loopback interface carries no group of this protocol.
    if (unshare(CLONE_NEWNET) != 0 ||
        std::system(
            "ip link add one type veth peer name other && ip link set one up && ip link set other up && "
            "ip -6 addr add fd00::1/64 dev one nodad && "
            "ip -6 route add multicast ff05::/16 dev one table local metric 1") != 0)
      return test::kNotPermitted;
    sockaddr_in6 group{};
    group.sin6_family = AF_INET6;
    group.sin6_port = htons(9000);
    inet_pton(AF_INET6, "ff05::1:2:3", &group.sin6_addr);
    return hear_group("ff05::1:2:3", group);
  });
  if (outcome == test::kNotPermitted) GTEST_SKIP() << "a private network namespace with IPv6 needs root";
  EXPECT_EQ(outcome, 0);
}

TEST(NetStream, AGroupThatNoInterfaceLeadsToSaysSo) {
  const int outcome = test::in_private_network([] {
    const auto stream = NetStream::open({NetKind::kUdp, "239.1.2.3", 9000});
    if (stream) return 1;
    return stream.error().text().find("the group cannot be joined") != std::string::npos &&
                   stream.error().remedy.find("multicast route") != std::string::npos
               ? 0
               : 2;
  });
  if (outcome == test::kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0);
}

/// Reads until something came.
IoResult read_soon(NetStream& stream, std::span<std::uint8_t> buffer) {
  pollfd waiting{stream.fd(), POLLIN, 0};
  EXPECT_EQ(poll(&waiting, 1, 2000), 1);
  return stream.read(buffer);
}

HostTime now() { return HostTime{std::chrono::steady_clock::now().time_since_epoch()}; }

TEST(NetStream, SaysWhenTheKernelReceivedADatagramThatWaited) {
  FarEnd sender(SOCK_DGRAM);
  const std::uint16_t port = FarEnd(SOCK_DGRAM).port();
  auto stream = NetStream::open({NetKind::kUdp, "", port});
  ASSERT_TRUE(stream) << stream.error().text();
  std::array<std::uint8_t, 100> buffer{};
  // The kernel begins to stamp a moment after it was asked to.
  for (int i = 0; i < 20; ++i) {
    sender.say_to(port, "first");
    (void)read_soon(**stream, buffer);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  for (int i = 0; i < 5; ++i) {
    const HostTime before = now();
    sender.say_to(port, "late");
    const HostTime after = now();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const IoResult result = read_soon(**stream, buffer);
    ASSERT_EQ(result.status, IoStatus::kDone);
    ASSERT_TRUE(result.received);
    EXPECT_GE(*result.received, before - std::chrono::milliseconds(1));
    EXPECT_LE(*result.received, after + std::chrono::milliseconds(20)) << "long before it was read";
  }
  EXPECT_EQ((*stream)->health().stamps.by, StampedBy::kKernel);
  EXPECT_GT((*stream)->health().stamps.lead_s, 1e-3);
}

TEST(NetStream, SaysWhenTheKernelReceivedTheLastByteOfAReadOverTcp) {
  FarEnd server(SOCK_STREAM);
  auto stream = NetStream::open({NetKind::kTcp, "127.0.0.1", server.port()});
  ASSERT_TRUE(stream) << stream.error().text();
  server.accept_one();
  std::array<std::uint8_t, 100> buffer{};
  for (int i = 0; i < 20; ++i) {
    server.say("first");
    (void)read_soon(**stream, buffer);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const HostTime before = now();
  server.say("one");
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  const HostTime between = now();
  server.say("two");
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const HostTime read = now();
  const IoResult result = read_soon(**stream, buffer);
  ASSERT_EQ(result.n, 6U);
  ASSERT_TRUE(result.received);
  EXPECT_GE(*result.received, between - std::chrono::milliseconds(1))
      << "of the second piece, not of the first";
  EXPECT_LT(*result.received, read - std::chrono::milliseconds(20));
  EXPECT_GT(read, before);
}

}  // namespace
}  // namespace imuscope
