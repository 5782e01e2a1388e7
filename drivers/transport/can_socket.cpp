#include "drivers/transport/can_socket.h"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/contracts.h"
#include "drivers/transport/can_interface.h"
#include "drivers/transport/kernel_stamp.h"
#include "drivers/transport/receive_buffer.h"

namespace imuscope {
namespace {

/// A full bus brings eight frames a millisecond: one call takes what comes while a thread wakes up.
constexpr std::size_t kFramesPerCall = 64;

Error no_socket(int error) {
  if (error == EAFNOSUPPORT || error == EPROTONOSUPPORT) {
    return {ErrorKind::kWork, "this kernel has no SocketCAN",
            "sudo modprobe can_raw; Debian's cloud kernel lacks it, linux-image-amd64 has it"};
  }
  return {ErrorKind::kWork, fmt::format("no CAN socket: {}", std::strerror(error)), ""};
}

/// The remote bit is in the mask, so that a request is not taken for the data; so is the width, so that 123
/// of 11 bits is not taken for 123 of 29.
std::vector<can_filter> filters_of(const std::vector<CanId>& ids) {
  std::vector<can_filter> filters;
  for (const CanId& id : ids) {
    const canid_t width = id.is_extended ? CAN_EFF_MASK : CAN_SFF_MASK;
    filters.push_back({id.id | (id.is_extended ? CAN_EFF_FLAG : 0U), width | CAN_EFF_FLAG | CAN_RTR_FLAG});
  }
  return filters;
}

template <typename T>
bool set_can_option(int fd, int level, int option, const T& value) noexcept {
  return setsockopt(fd, level, option, &value, sizeof value) == 0;
}

std::string description_of(const CanInterface& interface, const CanSettings& settings, int buffer_bytes) {
  std::string text = fmt::format("{} ({}", settings.interface, interface.takes_fd ? "CAN FD" : "CAN");
  if (interface.bit_rate > 0) text += fmt::format(", {} bit/s", interface.bit_rate);
  if (interface.listen_only) text += ", listen-only";
  text += fmt::format(", {} identifiers", settings.ids.size());
  if (!interface.is_up) text += ", down";
  if (const auto shortage = buffer_shortage(buffer_bytes, settings.receive_buffer_bytes); !shortage.empty())
    text += ", " + shortage;
  return text + ")";
}

}  // namespace

struct CanSocket::Batch {
  std::array<mmsghdr, kFramesPerCall> headers{};
  std::array<iovec, kFramesPerCall> vectors{};
  std::array<canfd_frame, kFramesPerCall> frames{};
  struct alignas(cmsghdr) Control {
    std::array<std::uint8_t, kStampControlBytes> bytes;
  };
  std::array<Control, kFramesPerCall> controls{};
  KernelStampMap stamps;

  Batch() {
    for (std::size_t i = 0; i < kFramesPerCall; ++i) {
      vectors[i] = {&frames[i], sizeof frames[i]};
      headers[i].msg_hdr.msg_iov = &vectors[i];
      headers[i].msg_hdr.msg_iovlen = 1;
      headers[i].msg_hdr.msg_control = controls[i].bytes.data();
    }
  }
};

CanSocket::CanSocket(std::string interface, int fd)
    : interface_(std::move(interface)), fd_(fd), batch_(std::make_unique<Batch>()) {}

CanSocket::~CanSocket() { ::close(fd_); }

Result<std::unique_ptr<CanSocket>> CanSocket::open(const CanSettings& settings) {
  const int fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0) return tl::unexpected<Error>(no_socket(errno));
  std::unique_ptr<CanSocket> opened(new CanSocket(settings.interface, fd));
  if (auto ready = opened->set_up(settings); !ready) return tl::unexpected<Error>(std::move(ready.error()));
  return opened;
}

Result<void> CanSocket::set_up(const CanSettings& settings) {
  const auto interface = look_at_can_interface(settings.interface);
  if (!interface) return tl::unexpected<Error>(interface.error());
  if (settings.ids.empty() || settings.ids.size() > CAN_RAW_FILTER_MAX) {
    return usage_error(
        fmt::format("{}: {} identifiers to listen to", settings.interface, settings.ids.size()),
        fmt::format("the kernel filters 1 to {} of them", CAN_RAW_FILTER_MAX));
  }
  const auto filters = filters_of(settings.ids);
  const auto filter_bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  constexpr can_err_mask_t kAllErrors = CAN_ERR_MASK;
  constexpr int kOn = 1;
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(settings.interface.c_str()));
  const bool good = setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), filter_bytes) == 0 &&
                    set_can_option(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, kAllErrors) &&
                    set_can_option(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, kOn) && ask_for_stamps(fd_) &&
                    set_can_option(fd_, SOL_SOCKET, SO_RXQ_OVFL, kOn) &&
                    bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  if (!good) {
    return work_error(fmt::format("{} cannot be listened to: {}", settings.interface, std::strerror(errno)),
                      "check it with: ip -details link show " + settings.interface);
  }
  const int granted = grow_receive_buffer(fd_, settings.receive_buffer_bytes);
  description_ = description_of(*interface, settings, granted);
  is_up_ = interface->is_up;
  return {};
}

IoResult CanSocket::read(std::span<std::uint8_t> buffer) noexcept {
  IMUSCOPE_EXPECTS(buffer.size() >= kCanRecordMaxBytes);
  const std::size_t room = std::min(buffer.size() / kCanRecordMaxBytes, kFramesPerCall);
  // The kernel writes the lengths that it used.
  for (std::size_t i = 0; i < room; ++i) batch_->headers[i].msg_hdr.msg_controllen = kStampControlBytes;
  int count = 0;
  do {
    count = recvmmsg(fd_, batch_->headers.data(), static_cast<unsigned>(room), MSG_DONTWAIT, nullptr);
  } while (count < 0 && errno == EINTR);
  if (count < 0) return failed_read(errno);
  is_up_ = true;
  batch_->stamps.begin_read(read_both_clocks());
  std::size_t n = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) n += take(i, buffer.subspan(n));
  return {n > 0 ? IoStatus::kDone : IoStatus::kNothing, n, static_cast<std::size_t>(count) == room};
}

IoResult CanSocket::failed_read(int error) noexcept {
  if (error == ENETDOWN) is_up_ = false;
  return {error == ENODEV || error == ENXIO || error == EBADF ? IoStatus::kGone : IoStatus::kNothing};
}

std::size_t CanSocket::take(std::size_t message, std::span<std::uint8_t> buffer) noexcept {
  msghdr& header = batch_->headers[message].msg_hdr;
  const KernelStamps stamps = stamps_of(header);
  for (const cmsghdr* control = CMSG_FIRSTHDR(&header); control != nullptr;
       control = CMSG_NXTHDR(&header, const_cast<cmsghdr*>(control))) {
    if (control->cmsg_level != SOL_SOCKET || control->cmsg_type != SO_RXQ_OVFL) continue;
    std::uint32_t total = 0;
    std::memcpy(&total, CMSG_DATA(control), sizeof total);
    frames_dropped_ += total - dropped_count_;  // modulo 2^32, as the count wraps
    dropped_count_ = total;
  }
  const canfd_frame& received = batch_->frames[message];
  const std::size_t n_bytes = batch_->headers[message].msg_len;
  const bool is_fd = n_bytes == CANFD_MTU;
  if ((!is_fd && n_bytes != CAN_MTU) || !is_can_length(received.len, is_fd)) {
    ++impossible_frames_;
    return 0;
  }
  CanFrame frame;
  frame.is_extended = (received.can_id & CAN_EFF_FLAG) != 0;
  frame.is_remote = (received.can_id & CAN_RTR_FLAG) != 0;
  frame.is_error = (received.can_id & CAN_ERR_FLAG) != 0;
  frame.id = received.can_id & (frame.is_extended || frame.is_error ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.is_fd = is_fd;
  frame.bit_rate_switched = is_fd && (received.flags & CANFD_BRS) != 0;
  frame.sender_error_state = is_fd && (received.flags & CANFD_ESI) != 0;
  frame.length = received.len;
  // In a classic frame the raw DLC lies where canfd_frame has its second reserved byte.
  frame.raw_dlc =
      !is_fd && received.len == CAN_MAX_DLEN && received.__res1 <= CAN_MAX_RAW_DLC ? received.__res1 : 0;
  frame.stamp = batch_->stamps.map(stamps);
  std::copy_n(std::begin(received.data), frame.payload().size(), frame.data.begin());
  return write_can_record(frame, buffer);
}

IoResult CanSocket::write(std::span<const std::uint8_t>) noexcept { return {}; }

bool CanSocket::interface_is_up() const noexcept {
  ifreq request{};
  std::memcpy(request.ifr_name, interface_.data(), std::min(interface_.size(), std::size_t{IFNAMSIZ - 1}));
  return ioctl(fd_, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) != 0;
}

LineHealth CanSocket::health() noexcept {
  // Going down is heard from read(); coming up is not heard before the first frame.
  if (!is_up_) is_up_ = interface_is_up();
  return {is_up_, frames_dropped_, batch_->stamps.quality()};
}

std::uint64_t CanSocket::hardware_stamps() const noexcept { return batch_->stamps.hardware_stamps(); }

}  // namespace imuscope
