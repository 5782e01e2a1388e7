#pragma once

/// The door of a monitoring system: GET /metrics over HTTP, where the configuration asks for it ([metrics]).
/// It reads the newest status and nothing else; however many ask, the service does no more for them than it
/// would for eight.

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "service/doors/status_board.h"

namespace imuscope {

/// Of the thread that answers, as the kernel shows it.
inline constexpr const char* kMetricsThreadName = "imuscope-metric";

class MetricsServer {
 public:
  static constexpr unsigned kClientsMax = 8;  ///< one more, and the oldest goes
  static constexpr unsigned kPatience_s = 5;  ///< with a client that neither asks nor takes its answer

  /// Listens, and answers from a thread of its own.
  /// @param address  numeric, IPv4 or IPv6. On a loopback address requests whose Host is another name are
  ///                 refused: a page in a browser may have its name lead here.
  /// @return kUsage for what is no address, kWork where it cannot be listened to
  static Result<std::unique_ptr<MetricsServer>> open(const std::string& address, std::uint16_t port,
                                                     const StatusBoard& board);
  ~MetricsServer();
  MetricsServer(const MetricsServer&) = delete;
  MetricsServer& operator=(const MetricsServer&) = delete;

 private:
  struct Impl;
  explicit MetricsServer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Whether a run offers its metrics there: whoever else has the port gives other pages. Waits at most
/// MetricsServer::kPatience_s.
[[nodiscard]] bool offers_metrics(const std::string& address, std::uint16_t port);

}  // namespace imuscope
