#pragma once

/// The mounting of several drives as a table for people.

#include "study/combination.h"

namespace imuscope::cli {

void print_combination(const Combination& combination);

}  // namespace imuscope::cli
