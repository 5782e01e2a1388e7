#pragma once

/// Memory of the test program that is in use now, as the system counts it.

#include <unistd.h>

#include <cstddef>
#include <fstream>

namespace imuscope::test {

inline std::size_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t size = 0;
  std::size_t resident = 0;
  statm >> size >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace imuscope::test
