#include "publish/lcm_socket_filter.h"

#include <linux/filter.h>
#include <linux/if_packet.h>
#include <net/if_arp.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdint>
#include <cstring>

#include "base/contracts.h"
#include "publish/lcm_datagram.h"

namespace imuscope {
namespace {

// A socket's filter sees the UDP header before the datagram.
constexpr std::uint32_t kUdpHeaderBytes = 8;
constexpr std::uint32_t kChannelOffset = kUdpHeaderBytes + kShortHeaderBytes;

using Program = std::vector<sock_filter>;

sock_filter load(std::uint16_t size, std::uint32_t offset) {
  return BPF_STMT(static_cast<std::uint16_t>(BPF_LD | size | BPF_ABS), offset);
}
sock_filter load_fact(int fact) { return load(BPF_W, static_cast<std::uint32_t>(SKF_AD_OFF + fact)); }
/// Goes `if_equal` or `if_not` steps further than to the next one.
sock_filter compare(std::uint32_t value, std::uint8_t if_equal, std::uint8_t if_not) {
  return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, if_equal, if_not);
}
sock_filter pass() { return BPF_STMT(BPF_RET | BPF_K, UINT32_MAX); }
sock_filter drop() { return BPF_STMT(BPF_RET | BPF_K, 0); }

/// A datagram of this PC comes over the loopback interface, or as the copy that the kernel hands back of what
/// it has sent on another one.
void append_origin(Program& program) {
  program.push_back(load_fact(SKF_AD_HATYPE));
  program.push_back(compare(ARPHRD_LOOPBACK, 3, 0));
  program.push_back(load_fact(SKF_AD_PKTTYPE));
  program.push_back(compare(PACKET_LOOPBACK, 1, 0));
  program.push_back(drop());
}

/// A load beyond a datagram's end drops it.
void append_kind(Program& program) {
  program.push_back(load(BPF_W, kUdpHeaderBytes));
  program.push_back(compare(kShortMessageMagic, 1, 0));
  program.push_back(drop());
}

/// Passes a datagram whose channel begins with `bytes`; otherwise goes on after these steps.
void append_channel(const std::string& bytes, Program& program) {
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
    program.push_back(compare(comparisons[i].value, 0, behind));
  }
  program.push_back(pass());
}

Program program_for(const std::vector<ChannelPattern>& channels, Reach reach) {
  Program program;
  if (reach == Reach::kThisPc) append_origin(program);
  append_kind(program);
  for (const auto& channel : channels) {
    IMUSCOPE_EXPECTS(channel.text.size() <= kMaxChannelBytes);  // so that a jump spans its comparisons
    append_channel(channel.any_ending ? channel.text : channel.text + '\0', program);
  }
  program.push_back(drop());
  return program;
}

}  // namespace

Result<void> attach_lcm_filter(int socket, const std::vector<ChannelPattern>& channels, Reach reach) {
  auto program = program_for(channels, reach);
  const sock_fprog filter{static_cast<std::uint16_t>(program.size()), program.data()};
  if (setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter) != 0) {
    return work_error(std::string("LCM: the kernel refuses the filter that keeps foreign datagrams out (") +
                          std::strerror(errno) + "), so nothing is listened to",
                      "a kernel without socket filters, or a container's rules, cannot serve here; "
                      "net.core.optmem_max below 20480 is too little");
  }
  return {};
}

}  // namespace imuscope
