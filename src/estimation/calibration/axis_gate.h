#pragma once

/// Bound of an innovation's square over its variance, per axis. E-3.

namespace imuscope {

/// @param probability  with which a good measurement passes
double axis_gate(double probability);

}  // namespace imuscope
