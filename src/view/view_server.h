#pragma once

/// The door of a browser: one page over HTTP, and what changes on it over a websocket. It serves no file, and
/// whatever a client does costs others nothing: clients, frames, queues and pauses are bounded.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/result.h"

namespace imuscope::view {

struct ViewDoor {
  std::string address = "127.0.0.1";  ///< numeric, IPv4 or IPv6
  std::uint16_t port = 8088;          ///< 0: one that is free
  std::string token;                  ///< is_token() (request_rules.h), or empty: none is asked for
};

/// What became of clients since the server was opened.
struct ViewCounters {
  std::size_t pages = 0;  ///< open now
  std::uint64_t pages_opened = 0;
  std::uint64_t requests_refused = 0;  ///< of a foreign origin, without the token, of what does not exist
  std::uint64_t clients_dropped = 0;   ///< too many, too slow to ask, or sent what no page sends
  std::uint64_t parts_left_out = 0;  ///< of pages that were slower than the data; they got the newest instead
};

class ViewServer {
 public:
  static constexpr std::size_t kPagesMax = 32;
  static constexpr std::size_t kAskingMax = 64;  ///< connections that are no page yet; then the oldest goes
  static constexpr std::size_t kHeaderMax = 8 * 1024;
  static constexpr int kPatience_s = 5;  ///< with a client that does not ask, or does not take its answer
  static constexpr int kSilence_s = 30;  ///< a page that answers no ping for so long is gone
  static constexpr std::size_t kQueueMax = 20;   ///< parts that wait for a page: two seconds
  static constexpr int kMessagesPerSecond = 20;  ///< of a page; one that sends more is dropped

  /// The whole picture for a page that has just come, or has missed something.
  using Whole = std::function<std::string()>;
  /// Is told what a page sent, at most kPageMessageMax bytes of UTF-8 of unknown content.
  using Said = std::function<void(std::string_view)>;

  /// Listens, and answers from a thread of its own, on which both functions are called.
  /// @param page  the HTML; its inline scripts and styles, and no others, are allowed to it
  /// @return kUsage for what is no address or token, kWork where it cannot be listened to
  static Result<std::unique_ptr<ViewServer>> open(const ViewDoor& door, std::string page, Whole whole,
                                                  Said said);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// Sends to every page. Any thread.
  void send(std::string part);
  [[nodiscard]] std::uint16_t port() const noexcept;
  /// Any thread.
  [[nodiscard]] ViewCounters counters() const;

 private:
  struct Impl;
  explicit ViewServer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace imuscope::view
