#include "service/recording/side_by_side.h"

#include <tbb/global_control.h>

namespace imuscope {

namespace {

std::size_t allowed_threads() {
  return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
}

}  // namespace

bool may_use_threads() { return allowed_threads() > 1; }

bool may_use_third_thread() { return allowed_threads() > 2; }

Reading reading_by_threads() { return may_use_threads() ? Reading::kAhead : Reading::kWhenAsked; }

}  // namespace imuscope
