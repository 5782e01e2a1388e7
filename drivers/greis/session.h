#pragma once

/// Speaks with a GREIS receiver: stops what it puts out, sets the internal epoch and asks for the messages
/// that the decoder reads. A receiver that cannot hear us (a line with receive only) is taken as it is: what
/// counts in the end are complete epochs.

#include <array>
#include <cstdint>

#include "drivers/device/device.h"
#include "drivers/greis/scanner.h"

namespace imuscope::greis {

/// What the session asks of the receiver.
struct SessionConfig {
  Duration period = std::chrono::milliseconds(100);  ///< between epochs; 50 ms to 10 s
  /// False: only listen. For receivers that are set up by somebody else.
  bool send_commands = true;
};

class Session final : public DeviceSession {
 public:
  explicit Session(const SessionConfig& config) noexcept;

  void on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  [[nodiscard]] std::span<const std::uint8_t> poll(HostTime now) noexcept override;
  [[nodiscard]] SessionState state() const noexcept override { return state_; }
  [[nodiscard]] std::string_view problem() const noexcept override;
  [[nodiscard]] bool wants_other_baud() const noexcept override { return wants_other_baud_; }

 private:
  static constexpr std::size_t kCommands = 3;
  static constexpr std::size_t kCommandMax = 128;
  static constexpr std::size_t kProblemMax = 256;

  struct Command {
    std::array<char, kCommandMax> text{};
    std::size_t size = 0;
  };

  void start(HostTime now) noexcept;
  void drain(HostTime now, bool at_end) noexcept;
  void on_message(const Frame& frame, HostTime now) noexcept;
  void on_reply(const Frame& frame) noexcept;
  void on_complete_epoch(HostTime now) noexcept;
  void next_command() noexcept;
  void set_problem(std::string_view text) noexcept;

  SessionConfig config_;
  std::array<Command, kCommands> commands_;
  Scanner scanner_;
  SessionState state_ = SessionState::kConnecting;
  std::array<char, kProblemMax> problem_{};
  std::size_t problem_size_ = 0;

  bool started_ = false;
  std::size_t command_ = 0;  ///< the one that waits for its reply; kCommands when all are done
  int tries_ = 0;            ///< of that command
  bool refused_ = false;     ///< problem_ tells which command the receiver refused
  HostTime sent_{};
  HostTime last_bytes_{};
  HostTime last_epoch_{};  ///< or begin of the attempt
  std::uint64_t bytes_since_epoch_ = 0;
  std::uint64_t frames_ = 0;
  bool wants_other_baud_ = false;

  // The epoch that is coming in.
  bool has_position_ = false;
};

}  // namespace imuscope::greis
