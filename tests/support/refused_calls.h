#pragma once

/// Calls of this thread to the kernel that are refused, as a signal, a damaged disk or a port that vanished
/// refuses them.

#include <array>
#include <cstddef>

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

}  // namespace imuscope::test
