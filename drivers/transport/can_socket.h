#pragma once

/// A CAN interface of this PC (can0, vcan0, slcan0), classic and FD, listened to through a raw SocketCAN
/// socket. The kernel lets through only the identifiers in use, and the error frames that tell of the bus; it
/// stamps every frame, and it counts what it had to drop. Nothing is ever sent.
///
/// An interface that goes down and comes up again keeps its socket (health() says which it is); one that is
/// removed says kGone.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "drivers/device/can_frame.h"
#include "drivers/transport/transport.h"

namespace imuscope {

/// Which interface to listen on, and to what.
struct CanSettings {
  std::string interface;
  std::vector<CanId> ids;  ///< what to let through; at least one, at most 512
  /// Bytes of kernel memory for frames that wait. A classic frame takes about 900 of them: 8 MB is a second
  /// of a full bus at 1 Mbit/s. Where the system grants less, describe() says so.
  int receive_buffer_bytes = 8 * 1024 * 1024;
};

class CanSocket final : public Transport {
 public:
  /// The interface may be down. Errors name the remedy: a missing interface lists the CAN interfaces there
  /// are. Not for the real-time thread.
  static Result<std::unique_ptr<CanSocket>> open(const CanSettings& settings);

  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;
  ~CanSocket() override;

  /// Moves whole records (see CanFrame), stamped on the host's time scale.
  /// @param buffer  of at least kCanRecordMaxBytes
  [[nodiscard]] IoResult read(std::span<std::uint8_t> buffer) noexcept override;
  /// A listener on a vehicle's bus does not speak: always kNothing.
  [[nodiscard]] IoResult write(std::span<const std::uint8_t> bytes) noexcept override;
  [[nodiscard]] int fd() const noexcept override { return fd_; }
  [[nodiscard]] LineHealth health() noexcept override;
  [[nodiscard]] std::string describe() const override { return description_; }

  /// Frames whose receive time the interface's own clock gave.
  [[nodiscard]] std::uint64_t hardware_stamps() const noexcept;
  /// Frames of a length that no CAN frame can have; a virtual bus passes them. They are not handed on.
  [[nodiscard]] std::uint64_t impossible_frames() const noexcept { return impossible_frames_; }

 private:
  /// What recvmmsg() writes into, set up once.
  struct Batch;

  CanSocket(std::string interface, int fd);
  Result<void> set_up(const CanSettings& settings);
  [[nodiscard]] std::size_t take(std::size_t message, std::span<std::uint8_t> buffer) noexcept;
  [[nodiscard]] bool interface_is_up() const noexcept;
  IoResult failed_read(int error) noexcept;

  std::string interface_;
  int fd_;
  std::string description_;
  std::unique_ptr<Batch> batch_;
  bool is_up_ = true;
  std::uint32_t dropped_count_ = 0;  ///< the kernel's, which wraps
  std::uint64_t frames_dropped_ = 0;
  std::uint64_t impossible_frames_ = 0;
};

}  // namespace imuscope
