#pragma once

/// Bytes over a network: a TCP connection that we open to a device (or to rtkrcv, str2str, a serial server),
/// or UDP datagrams that a device sends to us. A TCP server that goes away, or does not answer keep-alives
/// for some ten seconds, is gone; open it again. UDP has no connection: silence is all that shows.

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "drivers/transport/kernel_stamp.h"
#include "drivers/transport/transport.h"

namespace imuscope {

/// The far end of a TCP connection, or where UDP datagrams are awaited.
struct NetSettings {
  enum class Kind : std::uint8_t { kTcp, kUdp };
  Kind kind = Kind::kTcp;
  /// TCP: the server. UDP: empty, or the multicast group or own address that datagrams are sent to.
  std::string host;
  std::uint16_t port = 0;
};

class NetStream final : public Transport {
 public:
  /// Connects (within a second), or begins to listen for datagrams. Errors name the remedy. Not for the
  /// real-time thread.
  static Result<std::unique_ptr<NetStream>> open(const NetSettings& settings);

  NetStream(const NetStream&) = delete;
  NetStream& operator=(const NetStream&) = delete;
  ~NetStream() override;

  /// One datagram at most per call. Says when the kernel, or the card, received the last of the bytes.
  [[nodiscard]] IoResult read(std::span<std::uint8_t> buffer) noexcept override;
  /// What is said to a UDP device goes nowhere: such devices only send.
  [[nodiscard]] IoResult write(std::span<const std::uint8_t> bytes) noexcept override;
  [[nodiscard]] int fd() const noexcept override { return fd_; }
  /// Datagrams that the kernel had no room for, and those longer than the reader's buffer.
  [[nodiscard]] LineHealth health() noexcept override;
  [[nodiscard]] std::string describe() const override;

 private:
  NetStream(int fd, NetSettings settings, std::string shortage)
      : fd_(fd), settings_(std::move(settings)), shortage_(std::move(shortage)) {}
  [[nodiscard]] HostTime received(const msghdr& message) noexcept;

  int fd_;
  NetSettings settings_;
  std::string shortage_;  ///< of memory for datagrams that wait
  std::uint64_t datagrams_cut_ = 0;
  KernelStampMap stamps_;
};

}  // namespace imuscope
