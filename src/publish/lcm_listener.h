#pragma once

/// Hears messages over LCM.

#include <chrono>
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

/// Thread: one, of the soft world; the library adds one of its own that only receives.
class LcmListener {
 public:
  /// The bytes are valid during the call; decode_message() (message_codec.h) turns them into a message.
  using Handler = std::function<void(const std::string& channel, std::span<const std::uint8_t> message)>;

  /// @param url  udpm://ADDRESS:PORT?ttl=N, or file://PATH?speed=S, which plays an LCM log
  /// @return the errors of check_lcm_url()
  static Result<LcmListener> open(std::string_view url = kDefaultLcmUrl,
                                  std::string_view prefix = kDefaultChannelPrefix);

  LcmListener(LcmListener&&) noexcept;
  LcmListener& operator=(LcmListener&&) noexcept;
  ~LcmListener();

  /// @param kind   of channels, without the prefix, as a regular expression: "STATUS", "CALIBRATION_.*"
  /// @param queue  messages that may wait; when it is full the newest is lost, so a live display keeps it
  /// short
  void subscribe(std::string_view kind, Handler handler, int queue);

  /// Handles what has come, waiting for the first message at most for `timeout`. Returns how many messages
  /// were handled; -1 at the end of a log.
  int wait(std::chrono::milliseconds timeout);

 private:
  struct Impl;
  explicit LcmListener(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace imuscope
