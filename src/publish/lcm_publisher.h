#pragma once

/// Publishes messages over LCM. lcm_publisher.cpp is the only place that knows the LCM library.

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
#include "publish/message_codec.h"

namespace imuscope {

/// Messages stay within one UDP datagram: a larger one is lost whole when any of its fragments is.
inline constexpr std::size_t kMaxMessageBytes = 65'000;

/// What became of the messages since the publisher was opened.
struct PublishCounters {
  std::uint64_t published = 0;
  std::uint64_t failed = 0;     ///< the library would not send
  std::uint64_t too_large = 0;  ///< above kMaxMessageBytes; not sent
};

/// Thread: one, non-real-time (publishing allocates and makes system calls). A message that cannot be
/// sent is counted and given up: what is live is not worth waiting for.
class LcmPublisher {
 public:
  /// Opens the bus.
  /// @param url     udpm://ADDRESS:PORT?ttl=N, or file://PATH?mode=w to write messages into a fresh LCM log
  /// @param prefix  of every channel, without the underscore
  /// @return the errors of check_lcm_url()
  static Result<LcmPublisher> open(std::string_view url = kDefaultLcmUrl,
                                   std::string_view prefix = kDefaultChannelPrefix);

  /// Sends nothing before connect(); the tap gets every message all the same.
  static LcmPublisher unconnected(std::string_view prefix);
  /// Takes this bus, in place of an earlier one; sequences go on.
  /// @return the errors of check_lcm_url(); then all stays as it was
  [[nodiscard]] Result<void> connect(std::string_view url);

  LcmPublisher(LcmPublisher&&) noexcept;
  LcmPublisher& operator=(LcmPublisher&&) noexcept;
  ~LcmPublisher();

  /// Sends `message` on PREFIX_KIND, or PREFIX_KIND_NAME where the kind exists for each S-IMU. A type that
  /// has a sequence gets the next one of its channel.
  template <typename Message>
  void publish(Message message, std::string_view kind, std::string_view name = {}) {
    const std::string channel = channel_of(kind, name);
    if constexpr (requires { message.sequence; }) message.sequence = next_sequence(channel);
    send(channel, message.utime, encode_message(message));
  }

  /// Gives every message to `tap`, too, whether or not it can be sent: channel, utime and encoded bytes. For
  /// the recorder.
  using Tap = std::function<void(std::string_view, std::int64_t, std::span<const std::uint8_t>)>;
  void set_tap(Tap tap);

  [[nodiscard]] const PublishCounters& counters() const noexcept;

 private:
  struct Impl;
  [[nodiscard]] std::string channel_of(std::string_view kind, std::string_view name) const;
  [[nodiscard]] std::int64_t next_sequence(const std::string& channel);
  void send(const std::string& channel, std::int64_t utime, std::span<const std::uint8_t> message);
  explicit LcmPublisher(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace imuscope
