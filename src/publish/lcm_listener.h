#pragma once

/// Hears messages over LCM. With a socket of its own: the receiver of liblcm 1.3.1 starts before a filter can
/// stand in its way, and writes beyond its memory when fragments lie about their place.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"
#include "publish/channel_name.h"
#include "publish/lcm_url.h"

namespace imuscope {

/// Thread: one, non-real-time.
class LcmListener {
 public:
  /// The bytes are valid during the call; decode_message() (message_codec.h) turns them into a message.
  using Handler = std::function<void(const std::string& channel, std::span<const std::uint8_t> message)>;

  /// wait() handles no more of what has come than this and for no longer, however much comes: its caller has
  /// other things to do.
  static constexpr int kMostAtOnce = 200;
  static constexpr std::chrono::milliseconds kLongestAtOnce{20};

  /// Hears nothing until something is subscribed to. With ttl=0 it hears this PC alone, on whichever
  /// interface the bus lies.
  /// @param url  udpm://ADDRESS:PORT?ttl=N
  /// @return the errors of check_lcm_bus(), and kWork where the system refuses a part of the socket
  static Result<LcmListener> open(std::string_view url = kDefaultLcmUrl,
                                  std::string_view prefix = kDefaultChannelPrefix);

  LcmListener(LcmListener&&) noexcept;
  LcmListener& operator=(LcmListener&&) noexcept;
  ~LcmListener();

  /// The kernel keeps what may wait (net.core.rmem_default bytes), and drops what comes when that is full.
  /// @param kind  of channels, without the prefix: "STATUS", or "CALIBRATION_.*" for every name of that kind
  /// @return kUsage for a name longer than a channel's can be, kWork where the kernel refuses the filter;
  ///         then this kind is not heard
  [[nodiscard]] Result<void> subscribe(std::string_view kind, Handler handler);

  /// Handles what has come, waiting for the first message at most for `timeout`. Returns how many messages
  /// were handled.
  int wait(std::chrono::milliseconds timeout);

  /// Of the message that a handler is called for: how long it had waited to be read since the kernel received
  /// it. 0 where the kernel does not tell. Right as well where the wall clock, by which it does, was stepped
  /// (receive_age.h).
  [[nodiscard]] std::chrono::nanoseconds age() const noexcept;

 private:
  struct Impl;
  explicit LcmListener(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace imuscope
