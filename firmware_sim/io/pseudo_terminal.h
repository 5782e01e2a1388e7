#pragma once

/// A serial port made of software: a pseudo-terminal whose far end a program opens by a path of its choice.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <tl/expected.hpp>

#include "firmware_sim/io/line_end.h"

namespace imusim {

class PseudoTerminal : public LineEnd {
 public:
  /// Opens a pseudo-terminal and puts a symbolic link to it at `link`, replacing one that is there. The
  /// link's folder is made, for its owner alone, where it does not exist.
  /// @param baud  speed that the port has until a program sets another
  /// @return what went wrong, in one sentence
  static tl::expected<PseudoTerminal, std::string> open(const std::filesystem::path& link, int baud);

  PseudoTerminal(PseudoTerminal&& other) noexcept;
  PseudoTerminal& operator=(PseudoTerminal&&) = delete;
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;
  /// Closes it and removes the link, if it still leads here.
  ~PseudoTerminal() override;

  /// What the kernel does not take at once waits here, as in a USB adapter and its driver, and goes out with
  /// the next calls of write() or read(); what exceeds kWaitingMax, or waits when the far end is closed, is
  /// dropped.
  std::size_t write(std::span<const std::uint8_t> bytes) override;
  Bytes read() override;
  [[nodiscard]] int baud() const override;

  /// Whether a program has the port open.
  [[nodiscard]] bool is_open_elsewhere() const;

  [[nodiscard]] const std::filesystem::path& link() const { return link_; }
  [[nodiscard]] const std::string& terminal() const { return terminal_; }

 private:
  PseudoTerminal(int near_end, std::string terminal, std::filesystem::path link)
      : near_end_(near_end), terminal_(std::move(terminal)), link_(std::move(link)) {}

  /// What the Linux tty layer keeps for one port at most (TTYB_DEFAULT_MEM_LIMIT in
  /// drivers/tty/tty_buffer.c).
  static constexpr std::size_t kWaitingMax = 64UL * 1024;

  void push_waiting();

  int near_end_;
  Bytes waiting_{};
  std::string terminal_;
  std::filesystem::path link_;
};

}  // namespace imusim
