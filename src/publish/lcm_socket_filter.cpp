#include "publish/lcm_socket_filter.h"

#include <linux/filter.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include "publish/lcm_url.h"

namespace imuscope {
namespace {

// LCM's wire format of a whole message: magic, sequence number, channel with its terminating zero, content. A
// socket's filter sees the UDP header before it.
constexpr std::uint32_t kUdpHeaderBytes = 8;
constexpr std::uint32_t kMagic = 0x4c433032;  // "LC02"
constexpr std::uint32_t kChannelOffset = kUdpHeaderBytes + 8;
constexpr std::string_view kAnyEnding = ".*";
constexpr std::string_view kExpressionSigns = ".*+?[](){}|^$\\";

using Program = std::vector<sock_filter>;

sock_filter load(std::uint16_t size, std::uint32_t offset) {
  return BPF_STMT(static_cast<std::uint16_t>(BPF_LD | size | BPF_ABS), offset);
}
sock_filter pass() { return BPF_STMT(BPF_RET | BPF_K, UINT32_MAX); }
sock_filter drop() { return BPF_STMT(BPF_RET | BPF_K, 0); }

/// The bytes that a datagram of such a channel begins with; nothing for an expression of another kind.
std::optional<std::string> wanted_bytes(std::string_view channel) {
  const bool any_ending = channel.ends_with(kAnyEnding);
  if (any_ending) channel.remove_suffix(kAnyEnding.size());
  if (channel.find_first_of(kExpressionSigns) != std::string_view::npos) return std::nullopt;
  std::string bytes(channel);
  if (!any_ending) bytes.push_back('\0');
  return bytes;
}

/// Passes a datagram whose channel begins with `bytes`; otherwise goes on behind these steps.
void append_comparison(const std::string& bytes, Program& program) {
  struct Comparison {
    std::uint16_t size;
    std::uint32_t offset;
    std::uint32_t value;
  };
  std::vector<Comparison> comparisons;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t n = bytes.size() - at >= 4 ? 4 : bytes.size() - at >= 2 ? 2 : 1;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < n; ++i) value = value << 8U | static_cast<std::uint8_t>(bytes[at + i]);
    const auto size = static_cast<std::uint16_t>(n == 4 ? BPF_W : n == 2 ? BPF_H : BPF_B);
    comparisons.push_back({size, kChannelOffset + static_cast<std::uint32_t>(at), value});
    at += n;
  }
  for (std::size_t i = 0; i < comparisons.size(); ++i) {
    const auto behind = static_cast<std::uint8_t>(2 * (comparisons.size() - 1 - i) + 1);
    program.push_back(load(comparisons[i].size, comparisons[i].offset));
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, comparisons[i].value, 0, behind));
  }
  program.push_back(pass());
}

std::optional<Program> program_for(const std::vector<std::string>& channels) {
  Program program{load(BPF_W, kUdpHeaderBytes), BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kMagic, 1, 0), pass()};
  for (const auto& channel : channels) {
    const auto bytes = wanted_bytes(channel);
    // A jump of the filter spans 255 steps, two for each four bytes of a name.
    constexpr std::size_t kLongestName = 255;
    if (!bytes || bytes->size() > kLongestName) return std::nullopt;
    append_comparison(*bytes, program);
  }
  program.push_back(drop());
  return program;
}

/// Whether this descriptor is a UDP socket that hears `port`.
bool hears(int fd, std::uint16_t port) {
  int type = 0;
  socklen_t size = sizeof type;
  if (getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM) return false;
  sockaddr_in address{};
  size = sizeof address;
  return getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) == 0 &&
         address.sin_family == AF_INET && ntohs(address.sin_port) == port;
}

/// The sockets of this process that hear the bus: the library does not tell its own.
std::vector<int> receiving_sockets(std::string_view url) {
  std::vector<int> sockets;
  const auto port = udpm_port(url);
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", absent)) {
    const std::string name = entry.path().filename().string();
    int fd = -1;
    std::from_chars(name.data(), name.data() + name.size(), fd);
    if (port && hears(fd, *port)) sockets.push_back(fd);
  }
  return sockets;
}

}  // namespace

LcmSocketFilter::LcmSocketFilter(std::string url) : url_(std::move(url)), others_(receiving_sockets(url_)) {}

void LcmSocketFilter::let_through(const std::vector<std::string>& channels) const {
  auto program = program_for(channels);
  if (!program) return;
  const sock_fprog filter{static_cast<std::uint16_t>(program->size()), program->data()};
  for (const int fd : receiving_sockets(url_)) {
    if (std::find(others_.begin(), others_.end(), fd) != others_.end()) continue;
    (void)setsockopt(fd, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter);
  }
}

}  // namespace imuscope
