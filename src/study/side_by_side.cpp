#include "study/side_by_side.h"

#include <tbb/global_control.h>

namespace imuscope {

Reading reading_of_study() {
  const auto threads = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  return threads > 1 ? Reading::kAhead : Reading::kWhenAsked;
}

}  // namespace imuscope
