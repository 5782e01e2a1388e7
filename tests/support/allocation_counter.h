#pragma once

/// Counts every allocation of the test program (replaces the global operator new).

#include <cstdint>

namespace imuscope::test {
std::uint64_t allocation_count() noexcept;
}  // namespace imuscope::test
