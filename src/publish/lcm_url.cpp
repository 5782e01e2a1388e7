#include "publish/lcm_url.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <string>

namespace imuscope {
namespace {

constexpr std::string_view kDefaultAddress = "239.255.76.67";
constexpr std::uint16_t kDefaultPort = 7667;
constexpr std::uint32_t kMulticastMask = 0xf000'0000;  // 224.0.0.0/4
constexpr std::uint32_t kMulticastPrefix = 0xe000'0000;

/// The socket address of what stands between "udpm://" and '?'; both parts may be left out.
Result<sockaddr_in> parse_udpm_address(std::string_view url) {
  std::string_view place = url.substr(std::string_view("udpm://").size());
  place = place.substr(0, place.find('?'));
  const std::size_t colon = place.find(':');
  std::string address(place.substr(0, colon));
  if (address.empty()) address = kDefaultAddress;

  std::uint16_t port = kDefaultPort;
  if (colon != std::string_view::npos) {
    const std::string_view digits = place.substr(colon + 1);
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
    if (error != std::errc() || end != digits.data() + digits.size() || port == 0) {
      return usage_error("LCM URL " + std::string(url) + ": '" + std::string(digits) + "' is not a port",
                         kLcmUrlRemedy);
    }
  }
  sockaddr_in socket_address{};
  socket_address.sin_family = AF_INET;
  socket_address.sin_port = htons(port);
  if (inet_pton(AF_INET, address.c_str(), &socket_address.sin_addr) != 1 ||
      (ntohl(socket_address.sin_addr.s_addr) & kMulticastMask) != kMulticastPrefix) {
    return usage_error("LCM URL " + std::string(url) + ": '" + address +
                           "' is not a multicast address (224.0.0.0 to 239.255.255.255)",
                       kLcmUrlRemedy);
  }
  return socket_address;
}

/// Asks the kernel for a route before the library does, which would print advice of its own to the terminal.
Result<void> check_multicast_route(const sockaddr_in& address) {
  const int probe = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (probe < 0) return work_error(std::string("LCM: no socket (") + std::strerror(errno) + ")");
  const int status = ::connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const int error = errno;
  ::close(probe);
  if (status == 0) return {};
  char text[INET_ADDRSTRLEN] = {};
  inet_ntop(AF_INET, &address.sin_addr, text, sizeof text);
  return work_error(
      std::string("LCM: no route to the multicast address ") + text + " (" + std::strerror(error) + ")",
      "run 'ip link set lo up multicast on' and 'ip route add 224.0.0.0/4 dev lo' as root");
}

}  // namespace

std::optional<std::uint16_t> udpm_port(std::string_view url) {
  if (!url.starts_with("udpm://")) return std::nullopt;
  const auto address = parse_udpm_address(url);
  if (!address) return std::nullopt;
  return ntohs(address->sin_port);
}

Result<void> check_lcm_url(std::string_view url) {
  if (url.starts_with("udpm://")) {
    return parse_udpm_address(url).and_then(check_multicast_route);
  }
  if (url.starts_with("file://")) return {};
  if (url.starts_with("tcpq://")) {
    return usage_error(
        "LCM URL " + std::string(url) +
            ": tcpq cannot be used, its library call aborts the whole process when the server is absent",
        kLcmUrlRemedy);
  }
  return usage_error("LCM URL " + std::string(url) + ": imuscope speaks udpm:// (network) and file:// (log)",
                     kLcmUrlRemedy);
}

}  // namespace imuscope
