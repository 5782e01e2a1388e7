#include "publish/lcm_url.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>

namespace imuscope {
namespace {

constexpr std::string_view kDefaultAddress = "239.255.76.67";
constexpr std::uint16_t kDefaultPort = 7667;
constexpr std::uint32_t kMulticastMask = 0xf000'0000;  // 224.0.0.0/4
constexpr std::uint32_t kMulticastPrefix = 0xe000'0000;

constexpr std::string_view kUdpm = "udpm://";
constexpr std::string_view kFile = "file://";
constexpr std::string_view kWriteMode = "?mode=w";

/// The whole of `digits` as a number from `low` to the type's largest.
template <typename Number>
bool read_number(std::string_view digits, Number low, Number& number) {
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return error == std::errc() && end == digits.data() + digits.size() && number >= low;
}

tl::unexpected<Error> wrong(std::string_view url, const std::string& why) {
  return usage_error("LCM URL " + std::string(url) + ": " + why, kLcmUrlRemedy);
}

Result<void> parse_place(std::string_view url, std::string_view place, UdpmBus& bus) {
  const std::size_t colon = place.find(':');
  std::string address(place.substr(0, colon));
  if (address.empty()) address = kDefaultAddress;
  bus.port = kDefaultPort;
  if (colon != std::string_view::npos) {
    const std::string_view digits = place.substr(colon + 1);
    if (!read_number<std::uint16_t>(digits, 1, bus.port))
      return wrong(url, "'" + std::string(digits) + "' is not a port");
  }
  in_addr group{};
  if (inet_pton(AF_INET, address.c_str(), &group) != 1 ||
      (ntohl(group.s_addr) & kMulticastMask) != kMulticastPrefix) {
    return wrong(url, "'" + address + "' is not a multicast address (224.0.0.0 to 239.255.255.255)");
  }
  bus.group = ntohl(group.s_addr);
  return {};
}

Result<void> parse_options(std::string_view url, std::string_view options, UdpmBus& bus) {
  constexpr std::string_view kTtl = "ttl=";
  if (!options.starts_with(kTtl))
    return wrong(url, "'" + std::string(options) + "' is no option of it, there is ttl alone");
  const std::string_view digits = options.substr(kTtl.size());
  if (!read_number<std::uint8_t>(digits, 0, bus.ttl))
    return wrong(url, "ttl '" + std::string(digits) + "' is not a number from 0 to 255");
  return {};
}

/// Asks the kernel for a route before the library does, which would print advice of its own to the terminal.
Result<UdpmBus> check_multicast_route(UdpmBus bus) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(bus.port);
  address.sin_addr.s_addr = htonl(bus.group);
  const int probe = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (probe < 0) return work_error(std::string("LCM: no socket (") + std::strerror(errno) + ")");
  const int status = ::connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const int error = errno;
  sockaddr_in local{};
  socklen_t size = sizeof local;
  if (getsockname(probe, reinterpret_cast<sockaddr*>(&local), &size) == 0)
    bus.local = ntohl(local.sin_addr.s_addr);
  ::close(probe);
  if (status == 0) return bus;
  char text[INET_ADDRSTRLEN] = {};
  inet_ntop(AF_INET, &address.sin_addr, text, sizeof text);
  return work_error(
      std::string("LCM: no route to the multicast address ") + text + " (" + std::strerror(error) + ")",
      "run 'ip link set lo up multicast on' and 'ip route add 224.0.0.0/4 dev lo' as root");
}

}  // namespace

Result<UdpmBus> parse_udpm_url(std::string_view url) {
  if (!url.starts_with(kUdpm)) return wrong(url, "a bus is udpm://ADDRESS:PORT?ttl=N");
  const std::string_view rest = url.substr(kUdpm.size());
  const std::size_t question = rest.find('?');
  UdpmBus bus;
  if (auto place = parse_place(url, rest.substr(0, question), bus); !place)
    return tl::unexpected<Error>(place.error());
  if (question != std::string_view::npos) {
    if (auto options = parse_options(url, rest.substr(question + 1), bus); !options)
      return tl::unexpected<Error>(options.error());
  }
  return bus;
}

Result<UdpmBus> check_lcm_bus(std::string_view url) {
  return parse_udpm_url(url).and_then(check_multicast_route);
}

Result<void> check_lcm_url(std::string_view url) {
  if (url.starts_with(kUdpm)) return check_lcm_bus(url).map([](const UdpmBus&) {});
  if (url.starts_with(kFile)) {
    if (!url.ends_with(kWriteMode) || url.find('?') != url.size() - kWriteMode.size()) {
      return usage_error("LCM URL " + std::string(url) + ": a log can only be published into",
                         "write it as file://PATH?mode=w");
    }
    const std::string path(url.substr(kFile.size(), url.size() - kFile.size() - kWriteMode.size()));
    std::error_code absent;
    if (std::filesystem::symlink_status(path, absent).type() != std::filesystem::file_type::not_found) {
      return usage_error("LCM URL " + std::string(url) + ": " + path + " exists and would be written over",
                         "name a file that is not there, or remove it");
    }
    return {};
  }
  if (url.starts_with("tcpq://")) {
    return wrong(url,
                 "tcpq cannot be used, its library call aborts the whole process when the server is absent");
  }
  return wrong(url, "imuscope speaks udpm:// (network) and file:// (log)");
}

}  // namespace imuscope
