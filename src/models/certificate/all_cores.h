#pragma once

#include <cstddef>
#include <functional>

namespace imuscope::certificate {

/// Calls work(0) .. work(n - 1) side by side on all cores: a ForEachIndex.
void on_all_cores(std::size_t n, const std::function<void(std::size_t)>& work);

}  // namespace imuscope::certificate
