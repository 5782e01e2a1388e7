#pragma once

/// Calls of this thread to the kernel that are refused, as a signal, a damaged disk or a port that vanished
/// refuses them.

#include <array>
#include <cstddef>
#include <cstdint>

namespace imuscope::test {

enum class Call { kRead, kWrite, kPread, kPwrite, kRecv, kSend, kFdatasync, kEpollPwait2 };
inline constexpr std::size_t kRefusableCalls = 8;

/// While it lives, the next `times` calls fail with `error`. One at a time a call and thread.
class RefusedCalls {
 public:
  RefusedCalls(Call call, int error, int times = 1) noexcept;
  ~RefusedCalls();
  RefusedCalls(const RefusedCalls&) = delete;
  RefusedCalls& operator=(const RefusedCalls&) = delete;

  /// Calls still to be refused.
  [[nodiscard]] int left() const noexcept;

 private:
  Call call_;
};

/// Bytes that this program has written and then waited for until the disk had them.
[[nodiscard]] std::uint64_t synced_bytes() noexcept;

/// While it lives, no other thread's write to a file nor its wait for the disk returns, as behind a disk that
/// stands still. One at a time.
class StalledDisk {
 public:
  StalledDisk() noexcept;
  ~StalledDisk();
  StalledDisk(const StalledDisk&) = delete;
  StalledDisk& operator=(const StalledDisk&) = delete;

  /// Calls that have not returned.
  [[nodiscard]] int waiting() const noexcept;
};

}  // namespace imuscope::test
