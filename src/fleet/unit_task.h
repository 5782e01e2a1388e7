#pragma once

/// One unit over all its drives: what each quantity is on average, and what it changes by from drive to
/// drive; and one mounting of every campaign, with the test whether it is one.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/result.h"
#include "fleet/plan.h"

namespace imuscope::fleet {

inline constexpr const char* kUnitSchema = "imuscope.fleet-unit/1";

/// Whether the unit's result stands there, made of the studies as they are now.
bool unit_is_done(const UnitTask& task);

/// Does the task, unless its result stands there. Studies that have no result yet, or were refused, are left
/// out. Errors: kWork, a result that is not understood or cannot be written.
Result<void> do_unit(const UnitTask& task, const std::string& program);

}  // namespace imuscope::fleet
