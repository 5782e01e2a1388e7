#pragma once

/// Parts of a study that do not depend on each other.

#include <functional>
#include <vector>

namespace imuscope {

using Job = std::function<void()>;

/// Each thread takes the first job that is left: with the longest in front, none of them ends long after the others.
/// Returns when all are done.
void work_off(const std::vector<Job>& jobs);

}  // namespace imuscope
