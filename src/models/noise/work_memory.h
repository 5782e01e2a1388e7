#pragma once

/// Scratch memory for numbers, unset. Where it is large, in large pages: the first touch of a page is a fault
/// of the processor, and with pages of 4 kB the faults of ten million samples cost as much as all their levels.

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace imuscope::noise {

class WorkMemory {
 public:
  /// Throws std::bad_alloc, as a vector does.
  explicit WorkMemory(std::size_t doubles) {
    constexpr std::size_t kLargePage = std::size_t{2} << 20U;
    const std::size_t wanted = doubles * sizeof(double);
    const bool is_large = wanted >= 2 * kLargePage;
    const std::size_t bytes = is_large ? (wanted / kLargePage + 1) * kLargePage : wanted;
    // The library keeps small memory for the next call, but not where it was asked to align it.
    memory_.reset(
        static_cast<double*>(is_large ? std::aligned_alloc(kLargePage, bytes) : std::malloc(bytes)));
    if (!memory_ && bytes > 0) throw std::bad_alloc();
#if defined(__linux__)
    // Advice: where it is not taken, the memory is as good.
    if (is_large) (void)madvise(memory_.get(), bytes, MADV_HUGEPAGE);
#endif
  }
  [[nodiscard]] double* data() const noexcept { return memory_.get(); }

 private:
  struct Free {
    void operator()(double* memory) const noexcept { std::free(memory); }
  };
  std::unique_ptr<double, Free> memory_;
};

}  // namespace imuscope::noise
