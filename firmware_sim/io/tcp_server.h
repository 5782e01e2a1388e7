#pragma once

/// A device behind a TCP server, as RTKLIB's tools and network receivers offer it: one client at a time.

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

#include "firmware_sim/io/line_end.h"

namespace imusim {

class TcpServer : public LineEnd {
 public:
  /// Listens on an address of this PC.
  /// @param port      0: a free one, see port()
  /// @param greeting  sent to each client as it connects
  /// @return what went wrong, in one sentence
  static tl::expected<TcpServer, std::string> open(const std::string& address, std::uint16_t port,
                                                   Bytes greeting);

  TcpServer(TcpServer&& other) noexcept;
  TcpServer& operator=(TcpServer&&) = delete;
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;
  ~TcpServer() override;

  std::size_t write(std::span<const std::uint8_t> bytes) override;
  Bytes read() override;
  [[nodiscard]] int baud() const override { return 0; }

  [[nodiscard]] std::uint16_t port() const;

 private:
  TcpServer(int listener, Bytes greeting) : listener_(listener), greeting_(std::move(greeting)) {}
  void look_for_client();
  void drop_client();

  int listener_;
  int client_ = -1;
  Bytes greeting_;
};

}  // namespace imusim
