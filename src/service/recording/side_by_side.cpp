#include "service/recording/side_by_side.h"

#include <tbb/global_control.h>

namespace imuscope {

bool may_use_threads() {
  return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) > 1;
}

Reading reading_by_threads() { return may_use_threads() ? Reading::kAhead : Reading::kWhenAsked; }

}  // namespace imuscope
