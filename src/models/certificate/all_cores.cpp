#include "models/certificate/all_cores.h"

#include <algorithm>
#include <execution>
#include <numeric>
#include <vector>

namespace imuscope::certificate {

void on_all_cores(std::size_t n, const std::function<void(std::size_t)>& work) {
  std::vector<std::size_t> index(n);
  std::iota(index.begin(), index.end(), std::size_t{0});
  std::for_each(std::execution::par, index.begin(), index.end(), work);
}

}  // namespace imuscope::certificate
