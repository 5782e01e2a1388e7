#include "base/contracts.h"

#include <cstdio>
#include <cstdlib>

namespace imuscope::detail {

void contract_violation(const char* kind, const char* condition, const char* file, int line) noexcept {
  // stderr unbuffered and no allocation: this may run on a real-time thread with a broken heap.
  std::fprintf(stderr, "imuscope: %s violated: %s (%s:%d)\n", kind, condition, file, line);
  std::abort();
}

}  // namespace imuscope::detail
