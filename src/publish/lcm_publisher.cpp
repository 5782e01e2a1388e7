#include "publish/lcm_publisher.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "publish/message_builders.h"

namespace imuscope {
namespace {

constexpr std::string_view kDefaultAddress = "239.255.76.67";
constexpr std::uint16_t kDefaultPort = 7667;
constexpr std::uint32_t kMulticastMask = 0xf000'0000;  // 224.0.0.0/4
constexpr std::uint32_t kMulticastPrefix = 0xe000'0000;

const std::string kUrlRemedy = "write it as " + std::string(kDefaultLcmUrl);

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
                         kUrlRemedy);
    }
  }
  sockaddr_in socket_address{};
  socket_address.sin_family = AF_INET;
  socket_address.sin_port = htons(port);
  if (inet_pton(AF_INET, address.c_str(), &socket_address.sin_addr) != 1 ||
      (ntohl(socket_address.sin_addr.s_addr) & kMulticastMask) != kMulticastPrefix) {
    return usage_error("LCM URL " + std::string(url) + ": '" + address +
                           "' is not a multicast address (224.0.0.0 to 239.255.255.255)",
                       kUrlRemedy);
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

Result<void> check_url(std::string_view url) {
  if (url.starts_with("udpm://")) {
    return parse_udpm_address(url).and_then(check_multicast_route);
  }
  if (url.starts_with("file://")) return {};
  if (url.starts_with("tcpq://")) {
    return usage_error(
        "LCM URL " + std::string(url) +
            ": tcpq cannot be used, its library call aborts the whole process when the server is absent",
        kUrlRemedy);
  }
  return usage_error("LCM URL " + std::string(url) + ": imuscope speaks udpm:// (network) and file:// (log)",
                     kUrlRemedy);
}

}  // namespace

struct LcmPublisher::Impl {
  Impl(const std::string& url, std::string_view prefix_in) : lcm(url), prefix(prefix_in) {}

  /// Encodes and sends; `build` makes the message from its sequence number.
  template <typename Build>
  void send(const std::string& channel, const Build& build) {
    std::int64_t& sequence = sequences[channel];
    const auto message = build(sequence);
    sequence += 1;
    const int size = message.getEncodedSize();
    if (size < 0 || static_cast<std::size_t>(size) > kMaxMessageBytes) {
      counters.too_large += 1;
      return;
    }
    buffer.resize(static_cast<std::size_t>(size));
    if (message.encode(buffer.data(), 0, size) != size ||
        lcm.publish(channel, buffer.data(), static_cast<unsigned int>(size)) != 0) {
      counters.failed += 1;
      return;
    }
    counters.published += 1;
    if (tap) tap(channel, message.utime, buffer);
  }

  lcm::LCM lcm;
  std::string prefix;
  std::map<std::string, std::int64_t> sequences;  // by channel; counts what was lost here, too
  std::vector<std::uint8_t> buffer;
  PublishCounters counters;
  Tap tap;
};

Result<LcmPublisher> LcmPublisher::open(std::string_view url, std::string_view prefix) {
  if (const auto checked = check_url(url); !checked) return tl::unexpected(checked.error());
  auto impl = std::make_unique<Impl>(std::string(url), prefix);
  if (!impl->lcm.good()) {
    return work_error("LCM could not open " + std::string(url), "check its options; " + kUrlRemedy);
  }
  return LcmPublisher(std::move(impl));
}

LcmPublisher::LcmPublisher(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
LcmPublisher::LcmPublisher(LcmPublisher&&) noexcept = default;
LcmPublisher& LcmPublisher::operator=(LcmPublisher&&) noexcept = default;
LcmPublisher::~LcmPublisher() = default;

void LcmPublisher::publish(const StatusReport& report) {
  impl_->send(channel_name(impl_->prefix, "STATUS"),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const NavigationReport& report) {
  impl_->send(channel_name(impl_->prefix, "NAVIGATION"),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const CalibrationReport& report, const std::string& name) {
  impl_->send(channel_name(impl_->prefix, "CALIBRATION", name),
              [&](std::int64_t sequence) { return to_message(report, name, sequence); });
}

void LcmPublisher::publish(const ErrorReport& report, const std::string& name) {
  impl_->send(channel_name(impl_->prefix, "ERROR", name),
              [&](std::int64_t sequence) { return to_message(report, name, sequence); });
}

void LcmPublisher::publish(const WaveletVarianceReport& report) {
  impl_->send(channel_name(impl_->prefix, "WV", report.name),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const NoiseModelReport& report) {
  impl_->send(channel_name(impl_->prefix, "NOISE_MODEL", report.name),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::set_tap(Tap tap) { impl_->tap = std::move(tap); }

const PublishCounters& LcmPublisher::counters() const noexcept { return impl_->counters; }

}  // namespace imuscope
