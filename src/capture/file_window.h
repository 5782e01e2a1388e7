#pragma once

/// A file read from its beginning to its end through a window that moves on: what is looked at is copied once,
/// from the system, in large blocks. Non-real-time. Thread: one.

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <span>
#include <vector>

namespace imuscope {

class FileWindow {
 public:
  explicit FileWindow(std::ifstream file) : file_(std::move(file)) {}

  /// The next bytes: at least `n`, or all that are left where they are fewer. Valid until the next call. Memory
  /// follows what the file has, not `n`.
  [[nodiscard]] std::span<const std::uint8_t> look(std::size_t n);
  /// Moves on. Precondition: as many were seen by the last look().
  void pass(std::size_t n) noexcept { at_ += n; }

 private:
  std::ifstream file_;
  std::vector<std::uint8_t> bytes_;  ///< [at_, end_) are still to be passed
  std::size_t at_ = 0;
  std::size_t end_ = 0;
};

}  // namespace imuscope
