#pragma once

/// The session of a device that only sends and is set up by somebody else: it streams with its first good
/// message, and while there is none it says what is wrong. Core: no allocation, noexcept.

#include <cstdint>

#include "drivers/device/device.h"

namespace imuscope {

class ListeningSession : public DeviceSession {
 public:
  void on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept final {
    start(now);
    bytes_since_good_ += bytes.size();
    if (!hear(bytes, now)) return;
    heard_ = true;
    state_ = SessionState::kStreaming;
    problem_ = {};
    last_good_ = now;
    bytes_since_good_ = 0;
  }

  /// Always empty.
  [[nodiscard]] std::span<const std::uint8_t> poll(HostTime now) noexcept final {
    start(now);
    if (now - last_good_ > silence_) {
      state_ = SessionState::kFailed;
      problem_ = bytes_since_good_ == 0 ? nothing_comes() : nothing_is_understood();
    }
    return {};
  }

  [[nodiscard]] SessionState state() const noexcept final { return state_; }
  [[nodiscard]] bool wants_other_baud() const noexcept final {
    return state_ == SessionState::kFailed && bytes_since_good_ > kNoise && !heard_;
  }
  [[nodiscard]] std::string_view problem() const noexcept final { return problem_; }

 protected:
  /// @param silence  without a good message for this long something is wrong
  explicit ListeningSession(Duration silence) noexcept : silence_(silence) {}

  /// Whether a good message ended in these bytes.
  [[nodiscard]] virtual bool hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept = 0;
  /// One sentence each, with the remedy; of static storage.
  [[nodiscard]] virtual std::string_view nothing_comes() const noexcept = 0;
  [[nodiscard]] virtual std::string_view nothing_is_understood() const noexcept = 0;

 private:
  void start(HostTime now) noexcept {
    if (!started_) last_good_ = now;
    started_ = true;
  }

  /// Fewer bytes than this may come of plugging a cable in.
  static constexpr std::uint64_t kNoise = 64;

  Duration silence_;
  bool heard_ = false;
  SessionState state_ = SessionState::kConnecting;
  std::string_view problem_;
  bool started_ = false;
  HostTime last_good_{};  ///< or begin of the session
  std::uint64_t bytes_since_good_ = 0;
};

/// Hands the bytes of a read to a scanner; true where a frame ended in them that `counts`.
template <typename Frame, typename Scanner, typename Counts>
[[nodiscard]] bool scanner_hears(Scanner& scanner, std::span<const std::uint8_t> bytes, HostTime now,
                                 Counts&& counts) noexcept {
  bool heard = false;
  Frame frame;
  while (!bytes.empty()) {
    bytes = bytes.subspan(scanner.append(bytes, now));
    while (scanner.next(frame)) heard = counts(frame) || heard;
  }
  return heard;
}

}  // namespace imuscope
