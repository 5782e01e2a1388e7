#include "study/jobs.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <atomic>

namespace imuscope {

void work_off(const std::vector<Job>& jobs) {
  std::atomic<std::size_t> next{0};
  // Where a thread is in the range says nothing of which job it takes, only how many.
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, jobs.size()),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) jobs[next++]();
      },
      tbb::simple_partitioner());
}

}  // namespace imuscope
