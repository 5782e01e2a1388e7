#pragma once

/// A CAN interface in the words of netlink.

// Before the kernel's headers, which leave out what this one has defined.
#include <net/if.h>

#include <linux/can/netlink.h>
#include <linux/if_arp.h>
#include <linux/rtnetlink.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace imuscope::test {

using Bytes = std::vector<std::uint8_t>;

template <typename T>
Bytes bytes_as(const T& value, std::size_t size = sizeof(T)) {
  Bytes bytes(sizeof(T));
  std::memcpy(bytes.data(), &value, sizeof(T));
  bytes.resize(size);
  return bytes;
}

inline Bytes attribute(unsigned type, const Bytes& content) {
  rtattr head{};
  head.rta_type = static_cast<unsigned short>(type);
  head.rta_len = static_cast<unsigned short>(RTA_LENGTH(content.size()));
  Bytes bytes = bytes_as(head);
  bytes.insert(bytes.end(), content.begin(), content.end());
  bytes.resize(RTA_ALIGN(bytes.size()));
  return bytes;
}

inline void join(Bytes& bytes, const Bytes& more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

/// What netlink tells of a CAN interface.
struct MadeLink {
  std::string kind = "can";
  unsigned short type = ARPHRD_CAN;
  unsigned flags = IFF_UP;
  std::uint32_t mtu = CANFD_MTU;
  std::uint32_t state = CAN_STATE_ERROR_WARNING;
  std::uint32_t mode = CAN_CTRLMODE_LISTENONLY;
  bool has_controller = true;
  bool has_counts = true;
  std::uint64_t frames_received = 1234;
  std::size_t timing_bytes = sizeof(can_bittiming);
};

/// As netlink answers RTM_GETLINK.
inline Bytes link_answer(const MadeLink& link) {
  ifinfomsg info{};
  info.ifi_type = link.type;
  info.ifi_flags = link.flags;
  Bytes content = bytes_as(info);
  join(content, attribute(IFLA_MTU, bytes_as(link.mtu)));
  rtnl_link_stats64 counts{};
  counts.rx_packets = link.frames_received;
  counts.rx_over_errors = 56;
  join(content, attribute(IFLA_STATS64, bytes_as(counts)));
  Bytes controller;
  if (link.has_controller) {
    can_bittiming timing{};
    timing.bitrate = 250'000;
    join(controller, attribute(IFLA_CAN_STATE, bytes_as(link.state)));
    join(controller, attribute(IFLA_CAN_BITTIMING, bytes_as(timing, link.timing_bytes)));
    timing.bitrate = 2'000'000;
    join(controller, attribute(IFLA_CAN_DATA_BITTIMING, bytes_as(timing)));
    join(controller, attribute(IFLA_CAN_RESTART_MS, bytes_as(std::uint32_t{100})));
    join(controller, attribute(IFLA_CAN_CTRLMODE | NLA_F_NESTED, bytes_as(can_ctrlmode{0xFF, link.mode})));
    if (link.has_counts)
      join(controller, attribute(IFLA_CAN_BERR_COUNTER, bytes_as(can_berr_counter{17, 19})));
  }
  Bytes details = attribute(IFLA_INFO_KIND,
                            bytes_as(std::array<char, 8>{link.kind.at(0), link.kind.at(1), link.kind.at(2),
                                                         link.kind.size() > 3 ? link.kind.at(3) : '\0'},
                                     link.kind.size() + 1));
  if (link.has_controller) join(details, attribute(IFLA_INFO_DATA, controller));
  join(content, attribute(IFLA_LINKINFO, details));
  nlmsghdr head{};
  head.nlmsg_type = RTM_NEWLINK;
  head.nlmsg_len = static_cast<std::uint32_t>(NLMSG_LENGTH(content.size()));
  Bytes bytes = bytes_as(head);
  join(bytes, content);
  return bytes;
}

}  // namespace imuscope::test
