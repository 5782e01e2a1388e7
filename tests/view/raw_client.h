#pragma once

/// A client of the page as simple as it gets, which sends whatever a test wants: it shares no code with the
/// server. HTTP/1.1 by RFC 9112, frames by RFC 6455, section 5.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace imuscope::test {

class RawClient {
 public:
  explicit RawClient(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  RawClient(RawClient&& other) noexcept
      : socket_(std::exchange(other.socket_, -1)),
        connected_(other.connected_),
        bytes_(std::move(other.bytes_)) {}
  RawClient& operator=(RawClient&&) = delete;
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;
  ~RawClient() {
    if (socket_ >= 0) ::close(socket_);
  }

  [[nodiscard]] bool connected() const { return connected_; }
  void send(const std::string& bytes) const {
    (void)::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }

  /// What comes until the server closes, or nothing comes for so long.
  std::string rest(std::chrono::milliseconds patience = std::chrono::seconds(8)) {
    while (receive(patience)) {
    }
    return std::exchange(bytes_, {});
  }
  /// Whether the server has closed within that time.
  bool is_closed(std::chrono::milliseconds patience) {
    const auto end = std::chrono::steady_clock::now() + patience;
    while (!closed_ && std::chrono::steady_clock::now() < end) (void)receive(std::chrono::milliseconds(50));
    return closed_;
  }

  [[nodiscard]] std::string get(const std::string& target, const std::string& host,
                                const std::string& more = {}, const std::string& method = "GET") {
    send(method + " " + target + " HTTP/1.1\r\nHost: " + host + "\r\n" + more + "\r\n");
    return rest();
  }

  /// Asks for a websocket. The head of the answer.
  std::string upgrade(const std::string& host, const std::string& target = "/live",
                      const std::string& more = {}) {
    send("GET " + target + " HTTP/1.1\r\nHost: " + host +
         "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
         "Sec-WebSocket-Version: 13\r\n" +
         more + "\r\n");
    while (bytes_.find("\r\n\r\n") == std::string::npos)
      if (!receive(std::chrono::seconds(8))) return std::exchange(bytes_, {});
    const std::size_t end = bytes_.find("\r\n\r\n") + 4;
    std::string head = bytes_.substr(0, end);
    bytes_.erase(0, end);
    return head;
  }

  /// A frame as a client sends it, with the mask 0.
  static std::string frame(const std::string& content, unsigned char first = 0x81) {
    std::string out(1, static_cast<char>(first));
    constexpr unsigned char kMasked = 0x80;
    if (content.size() < 126) {
      out += static_cast<char>(kMasked | content.size());
    } else {
      out += static_cast<char>(kMasked | 126U);
      out += static_cast<char>(content.size() >> 8U);
      out += static_cast<char>(content.size() & 0xffU);
    }
    return out + std::string(4, '\0') + content;
  }

  /// The next text of the server; nothing when it closes or is silent for so long.
  std::optional<std::string> next_text(std::chrono::milliseconds patience = std::chrono::seconds(8)) {
    while (true) {
      if (const auto frame = take_frame()) {
        constexpr unsigned kText = 1;
        if (frame->first == kText) return frame->second;
        continue;  // pings and the like
      }
      if (!receive(patience)) return std::nullopt;
    }
  }

 private:
  bool receive(std::chrono::milliseconds patience) {
    pollfd input{socket_, POLLIN, 0};
    if (closed_ || ::poll(&input, 1, static_cast<int>(patience.count())) <= 0) return false;
    std::array<char, 65536> block{};
    const auto n = ::recv(socket_, block.data(), block.size(), 0);
    closed_ = n <= 0;
    if (n > 0) bytes_.append(block.data(), static_cast<std::size_t>(n));
    return n > 0;
  }

  std::optional<std::pair<unsigned, std::string>> take_frame() {
    const auto at = [this](std::size_t i) { return static_cast<unsigned char>(bytes_[i]); };
    if (bytes_.size() < 2) return std::nullopt;
    const unsigned opcode = at(0) & 0x0fU;
    std::uint64_t length = at(1) & 0x7fU;
    std::size_t head = 2;
    const std::size_t more = length == 126 ? 2 : length == 127 ? 8 : 0;
    if (bytes_.size() < head + more) return std::nullopt;
    if (more > 0) length = 0;
    for (std::size_t i = 0; i < more; ++i) length = length << 8U | at(head + i);
    head += more;
    if (bytes_.size() < head + length) return std::nullopt;
    std::string content = bytes_.substr(head, length);
    bytes_.erase(0, head + length);
    return std::pair(opcode, std::move(content));
  }

  int socket_;
  bool connected_ = false;
  bool closed_ = false;
  std::string bytes_;
};

}  // namespace imuscope::test
