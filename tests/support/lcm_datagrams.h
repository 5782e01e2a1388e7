#pragma once

/// Datagrams of LCM's multicast protocol as anybody on a network can send them, right or wrong.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace imuscope::test {

/// Puts `value` into `bytes`, most significant byte first.
template <typename Number>
void append_big_endian(std::string& bytes, Number value) {
  for (std::size_t i = sizeof value; i-- > 0;)
    bytes.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xffU));
}

/// A whole message.
inline std::string lc02(std::string_view channel, std::string_view message) {
  std::string datagram = "LC02";
  append_big_endian<std::uint32_t>(datagram, 1);
  return datagram + std::string(channel) + '\0' + std::string(message);
}

struct Fragment {
  std::uint32_t message_bytes = 0;
  std::uint32_t offset = 0;
  std::uint16_t number = 0;
  std::uint16_t fragments = 2;
};

/// One fragment of a long message; the first carries the channel before its content.
inline std::string lc03(const Fragment& fragment, std::string_view content) {
  std::string datagram = "LC03";
  append_big_endian<std::uint32_t>(datagram, 7);
  append_big_endian(datagram, fragment.message_bytes);
  append_big_endian(datagram, fragment.offset);
  append_big_endian(datagram, fragment.number);
  append_big_endian(datagram, fragment.fragments);
  return datagram + std::string(content);
}

/// Sends datagrams to the default bus.
class BusSender {
 public:
  explicit BusSender(int ttl = 0) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    (void)setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  }
  ~BusSender() { ::close(socket_); }
  BusSender(const BusSender&) = delete;
  BusSender& operator=(const BusSender&) = delete;

  /// Returns whether the system took it.
  [[nodiscard]] bool send(std::string_view datagram) const {
    constexpr std::uint16_t kPort = 7667;
    sockaddr_in bus{};
    bus.sin_family = AF_INET;
    bus.sin_port = htons(kPort);
    inet_pton(AF_INET, "239.255.76.67", &bus.sin_addr);
    return sendto(socket_, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&bus),
                  sizeof bus) == static_cast<ssize_t>(datagram.size());
  }

  /// The two that make liblcm 1.3.1 write 4 GiB past its buffer: the sum of the second one's offset and
  /// size is taken in 32 bits.
  [[nodiscard]] bool send_two_that_kill(std::string_view channel) const {
    constexpr std::uint32_t kMessageBytes = 1000;
    return send(lc03({kMessageBytes, 0, 0}, std::string(channel) + '\0' + "beginning")) &&
           send(lc03({kMessageBytes, 0xffff'ff80, 1}, std::string(256, 'x')));
  }

 private:
  int socket_;
};

}  // namespace imuscope::test
