#pragma once

/// A device that sends datagrams, one a message, as network outputs of navigation units do. It hears nothing.

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

#include "firmware_sim/io/line_end.h"

namespace imusim {

class UdpSender : public LineEnd {
 public:
  /// @param address  where to: of a PC, or a multicast group; empty: this PC
  /// @return what went wrong, in one sentence
  static tl::expected<UdpSender, std::string> open(const std::string& address, std::uint16_t port);

  UdpSender(UdpSender&& other) noexcept;
  UdpSender& operator=(UdpSender&&) = delete;
  UdpSender(const UdpSender&) = delete;
  UdpSender& operator=(const UdpSender&) = delete;
  ~UdpSender() override;

  std::size_t write(std::span<const std::uint8_t> bytes) override;
  Bytes read() override { return {}; }
  [[nodiscard]] int baud() const override { return 0; }

 private:
  explicit UdpSender(int socket) : socket_(socket) {}
  int socket_;
};

}  // namespace imusim
