#pragma once

/// Cases that do not depend on each other, worked on side by side.

#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace imuscope {

/// Calls work(i) once for every i below n, each on one of so many threads, the caller's among them, in no order.
/// What it makes belongs into places of its own, to be summed in their order: then the number of threads changes
/// nothing. An exception of `work` ends the program.
template <typename Work>
void on_all_threads(std::size_t n, std::size_t threads, const Work& work) {
  std::atomic<std::size_t> next{0};
  const auto take = [&]() noexcept {
    for (std::size_t i = next++; i < n; i = next++) work(i);
  };
  std::vector<std::thread> helpers;
  for (std::size_t i = 1; i < threads; ++i) helpers.emplace_back(take);
  take();
  for (std::thread& helper : helpers) helper.join();
}

}  // namespace imuscope
