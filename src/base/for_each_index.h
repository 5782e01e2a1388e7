#pragma once

/// How a library that knows no threads lets its caller spread its work over the cores.

#include <cstddef>
#include <functional>

namespace imuscope {

/// Calls work(0) .. work(n - 1), in any order, perhaps side by side, and returns when all are done.
using ForEachIndex = std::function<void(std::size_t n, const std::function<void(std::size_t)>& work)>;

/// One after the other.
inline void one_by_one(std::size_t n, const std::function<void(std::size_t)>& work) {
  for (std::size_t i = 0; i < n; ++i) work(i);
}

}  // namespace imuscope
