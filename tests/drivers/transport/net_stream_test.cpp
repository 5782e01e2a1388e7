#include "drivers/transport/net_stream.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

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

}  // namespace
}  // namespace imuscope
