#include "drivers/transport/can_interface.h"

// Before the kernel's headers, which leave out what this one has defined.
#include <net/if.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <linux/can.h>
#include <linux/can/netlink.h>
#include <linux/if_arp.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <span>
#include <utility>

namespace imuscope {
namespace {

namespace fs = std::filesystem;
using Bytes = std::span<const std::uint8_t>;

constexpr std::array<std::string_view, 7> kStateNames{
    "unknown", "error-active", "error-warning", "error-passive", "bus-off", "stopped", "sleeping"};

/// The attributes of one netlink level, by type.
std::map<int, Bytes> attributes_of(Bytes bytes) {
  std::map<int, Bytes> found;
  while (bytes.size() >= sizeof(rtattr)) {
    rtattr attribute{};
    std::memcpy(&attribute, bytes.data(), sizeof attribute);
    if (attribute.rta_len < sizeof attribute || attribute.rta_len > bytes.size()) break;
    found[attribute.rta_type & NLA_TYPE_MASK] =
        bytes.subspan(RTA_LENGTH(0), attribute.rta_len - static_cast<std::size_t>(RTA_LENGTH(0)));
    bytes = bytes.subspan(std::min<std::size_t>(RTA_ALIGN(attribute.rta_len), bytes.size()));
  }
  return found;
}

template <typename T>
std::optional<T> value_of(const std::map<int, Bytes>& attributes, int type) {
  const auto found = attributes.find(type);
  if (found == attributes.end()) return std::nullopt;
  // Older kernels give shorter structures: what is missing is zero.
  T value{};
  std::memcpy(&value, found->second.data(), std::min(sizeof value, found->second.size()));
  return value;
}

/// Asks for one link by its name.
/// @return the answer, beginning with its ifinfomsg; errno where there is none
tl::expected<std::vector<std::uint8_t>, int> ask_for_link(const std::string& name) {
  struct {
    nlmsghdr header{};
    ifinfomsg link{};
    std::array<std::uint8_t, RTA_SPACE(IFNAMSIZ)> attribute{};
  } request;
  request.header.nlmsg_len = sizeof request;
  request.header.nlmsg_type = RTM_GETLINK;
  request.header.nlmsg_flags = NLM_F_REQUEST;
  rtattr attribute{};
  attribute.rta_type = IFLA_IFNAME;
  attribute.rta_len = static_cast<std::uint16_t>(RTA_LENGTH(name.size() + 1));
  std::memcpy(request.attribute.data(), &attribute, sizeof attribute);
  std::memcpy(request.attribute.data() + RTA_LENGTH(0), name.c_str(), name.size() + 1);

  const int fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
  if (fd < 0) return tl::unexpected<int>(errno);
  constexpr std::size_t kAnswerBytes = 32768;
  std::vector<std::uint8_t> answer(kAnswerBytes);
  ssize_t n = send(fd, &request, sizeof request, 0);
  if (n >= 0) n = recv(fd, answer.data(), answer.size(), 0);
  const int error = errno;
  ::close(fd);
  if (n < static_cast<ssize_t>(NLMSG_LENGTH(0))) return tl::unexpected<int>(n < 0 ? error : EPROTO);
  nlmsghdr header{};
  std::memcpy(&header, answer.data(), sizeof header);
  if (header.nlmsg_type == NLMSG_ERROR) {
    nlmsgerr refusal{};
    std::memcpy(&refusal, answer.data() + NLMSG_LENGTH(0), sizeof refusal);
    return tl::unexpected<int>(-refusal.error);
  }
  answer.resize(std::min<std::size_t>(header.nlmsg_len, static_cast<std::size_t>(n)));
  answer.erase(answer.begin(), answer.begin() + NLMSG_LENGTH(0));
  return answer;
}

void read_controller(const std::map<int, Bytes>& can, CanInterface& interface) {
  if (const auto state = value_of<std::uint32_t>(can, IFLA_CAN_STATE); state && *state < CAN_STATE_MAX) {
    interface.state = static_cast<CanControllerState>(*state + 1);
  }
  interface.bit_rate = value_of<can_bittiming>(can, IFLA_CAN_BITTIMING).value_or(can_bittiming{}).bitrate;
  interface.data_bit_rate =
      value_of<can_bittiming>(can, IFLA_CAN_DATA_BITTIMING).value_or(can_bittiming{}).bitrate;
  interface.restart_ms = value_of<std::uint32_t>(can, IFLA_CAN_RESTART_MS).value_or(0);
  const auto mode = value_of<can_ctrlmode>(can, IFLA_CAN_CTRLMODE).value_or(can_ctrlmode{});
  interface.listen_only = (mode.flags & CAN_CTRLMODE_LISTENONLY) != 0;
  if (const auto errors = value_of<can_berr_counter>(can, IFLA_CAN_BERR_COUNTER)) {
    interface.tx_errors = errors->txerr;
    interface.rx_errors = errors->rxerr;
  }
}

CanInterface read_link(const std::string& name, Bytes answer, const ifinfomsg& link) {
  CanInterface interface;
  interface.name = name;
  interface.is_up = (link.ifi_flags & IFF_UP) != 0;
  const auto attributes = attributes_of(answer.subspan(NLMSG_ALIGN(sizeof link)));
  interface.takes_fd = value_of<std::uint32_t>(attributes, IFLA_MTU).value_or(0) == CANFD_MTU;
  const auto counts = value_of<rtnl_link_stats64>(attributes, IFLA_STATS64).value_or(rtnl_link_stats64{});
  interface.frames_received = counts.rx_packets;
  interface.controller_overruns = counts.rx_over_errors;
  const auto details = attributes.find(IFLA_LINKINFO);
  if (details == attributes.end()) return interface;
  const auto info = attributes_of(details->second);
  if (const auto kind = info.find(IFLA_INFO_KIND); kind != info.end()) {
    interface.kind.assign(kind->second.begin(), std::find(kind->second.begin(), kind->second.end(), 0));
  }
  if (const auto data = info.find(IFLA_INFO_DATA); data != info.end() && interface.kind == "can") {
    read_controller(attributes_of(data->second), interface);
  }
  return interface;
}

std::string use_another() {
  const auto others = can_interfaces();
  return others.empty() ? "plug the CAN adapter in, or load its driver; this PC has no CAN interface at all"
                        : fmt::format("plug the CAN adapter in, or use one of: {}", fmt::join(others, ", "));
}

Error no_interface(const std::string& name, int error) {
  const std::string remedy = use_another();
  if (error == ENODEV) {
    return {ErrorKind::kWork, fmt::format("CAN interface {} does not exist", name), remedy};
  }
  return {ErrorKind::kWork, fmt::format("CAN interface {}: {}", name, std::strerror(error)), remedy};
}

bool is_virtual(const CanInterface& interface) { return interface.kind != "can"; }

/// How the interface comes up; another bit rate than now where one is set that may be wrong.
std::string up_command(const CanInterface& interface) {
  if (is_virtual(interface)) return fmt::format("sudo ip link set {} up", interface.name);
  constexpr std::uint32_t kUsualBitRate = 500'000;
  return fmt::format("sudo ip link set {} up type can bitrate {} restart-ms 100", interface.name,
                     interface.bit_rate > 0 ? interface.bit_rate : kUsualBitRate);
}

std::string rate_text(const CanInterface& interface) {
  return interface.bit_rate > 0 ? fmt::format(" at {} bit/s", interface.bit_rate) : "";
}

std::string bus_off_text(const CanInterface& interface) {
  const std::string what =
      fmt::format("{} is bus-off: after too many errors its controller has gone silent", interface.name);
  if (interface.restart_ms > 0) {
    return fmt::format("{}; it starts again every {} ms; check wiring, termination and the bit rate{}", what,
                       interface.restart_ms, rate_text(interface));
  }
  return fmt::format(
      "{}; check wiring, termination and the bit rate{}, then: sudo ip link set {} type can restart "
      "(restart-ms 100 does so by itself)",
      what, rate_text(interface), interface.name);
}

/// Without numbers that change from one look to the next: a text that stays the same is said once.
std::string silence_text(const CanInterface& interface, const CanObservation& seen) {
  const bool errors = seen.error_frames > 0 || interface.state == CanControllerState::kPassive ||
                      interface.state == CanControllerState::kWarning;
  // The two counts are not of the same instant, and some drivers count errors as received.
  if (errors && seen.other_frames <= seen.error_frames) {
    return fmt::format(
        "{} hears only errors{} (state {}): the bit rate is probably not the bus's; sudo ip link set {} "
        "down, then up with another bitrate",
        interface.name, rate_text(interface), name_of(interface.state), interface.name);
  }
  if (seen.other_frames > 0) {
    return fmt::format(
        "{} carries frames, but none with the identifiers in use ({}); compare with: candump {}",
        interface.name, seen.ids, interface.name);
  }
  return fmt::format("nothing is heard on {}{}; check that the bus is awake, the wiring, and the bit rate",
                     interface.name, rate_text(interface));
}

}  // namespace

std::string_view name_of(CanControllerState state) { return kStateNames[static_cast<std::size_t>(state)]; }

std::vector<std::string> can_interfaces() {
  std::vector<std::string> names;
  std::error_code ignored;
  for (fs::directory_iterator it("/sys/class/net", ignored), end; !ignored && it != end;
       it.increment(ignored)) {
    int type = 0;
    std::ifstream(it->path() / "type") >> type;
    if (type == ARPHRD_CAN) names.push_back(it->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

Result<CanInterface> look_at_can_interface(const std::string& name) {
  if (name.empty() || name.size() >= IFNAMSIZ) {
    return usage_error(fmt::format("'{}' is no name of a CAN interface", name),
                       fmt::format("names have 1 to {} characters, such as can0", IFNAMSIZ - 1));
  }
  const auto answer = ask_for_link(name);
  if (!answer) return tl::unexpected<Error>(no_interface(name, answer.error()));
  ifinfomsg link{};
  if (answer->size() < NLMSG_ALIGN(sizeof link)) return tl::unexpected<Error>(no_interface(name, EPROTO));
  std::memcpy(&link, answer->data(), sizeof link);
  if (link.ifi_type != ARPHRD_CAN) {
    return usage_error(fmt::format("{} is not a CAN interface", name), use_another());
  }
  return read_link(name, *answer, link);
}

std::string explain_can_trouble(const CanInterface& interface, const CanObservation& seen) {
  /// A bus in use is never this long without a frame that matters to imuscope.
  constexpr double kSilence_s = 1.0;
  if (!interface.is_up) return fmt::format("{} is down; {}", interface.name, up_command(interface));
  if (interface.state == CanControllerState::kBusOff) return bus_off_text(interface);
  if (seen.silent_s >= kSilence_s) return silence_text(interface, seen);
  if (seen.frames_dropped > 0) {
    return fmt::format(
        "{} frames of {} were lost on this PC, which did not read them in time; sudo sysctl "
        "net.core.rmem_max=8388608 gives more room, imuscope doctor says what holds the threads up",
        seen.frames_dropped, interface.name);
  }
  if (interface.state == CanControllerState::kPassive) {
    return fmt::format("{} is error-passive: every other frame is damaged; check wiring and termination",
                       interface.name);
  }
  return {};
}

}  // namespace imuscope
